//! N_nv, N_v and D of several studies' optima against C.

use crate::laws::{Coefficient, Laws, Parameters};

use super::axis::{Axis, Scale};
use super::fitted::minima;
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::quantity::{Quantity, quantities};
use super::scene::{Dash, Scene};
use super::series::{Look, category_looks, law_stroke};

/// A study: its name and its laws through all budgets.
pub type Study<'a> = (&'a str, &'a Laws);

/// The page, or the reason why there is none.
pub fn draw(studies: &[Study]) -> Result<Scene, String> {
    let looks = category_looks(studies.len());
    let size_alone = studies.iter().all(|(_, laws)| laws.parameters == Parameters::Total);
    let quantities = quantities(size_alone);
    let plots = quantities.iter().map(|quantity| plot(quantity, studies));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let (mut scene, panels) = page(studies, &looks).panels(plots);
    for (quantity, panel) in quantities.iter().zip(&panels) {
        panel.backdrop(&mut scene);
        for ((_, laws), look) in studies.iter().zip(&looks) {
            draw_study(quantity, &mut scene, panel, laws, *look);
        }
    }
    Ok(scene)
}

fn page(studies: &[Study], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Study");
    for ((name, _), look) in studies.iter().zip(looks) {
        legend.entry(Sample::MarkedLine(law_stroke(look.colour), look.mark()), *name);
    }
    legend.entry(Sample::Line(law_stroke(looks[0].colour).dash(Dash::Dashed)), "95 % interval");
    let title = "Optimal configurations of several studies".to_string();
    let remarks = "Lines are the optimum by the law that each study recommends, marks the minima."
        .to_string();
    Page { width: 1250.0, height: 440.0, title, remarks, legend }
}

fn plot(quantity: &Quantity, studies: &[Study]) -> Result<Plot, String> {
    let points = studies.iter().flat_map(|(_, laws)| {
        minima(laws).into_iter().map(|(minimum, _)| (minimum.budget_flops, (quantity.of)(minimum)))
    });
    let points: Vec<(f64, f64)> = points.collect();
    if points.is_empty() {
        return Err("no study holds a minimum".to_string());
    }
    Ok(Plot {
        title: Vec::new(),
        x: Axis::new("Training compute C (FLOPs)", Scale::Log, points.iter().map(|p| p.0))?,
        y: Axis::new(quantity.label, Scale::Log, points.iter().map(|p| p.1))?,
    })
}

fn draw_study(quantity: &Quantity, scene: &mut Scene, panel: &Panel, laws: &Laws, look: Look) {
    let stroke = law_stroke(look.colour);
    let path = quantity.path(&laws.answer());
    let along = |of: fn(&Coefficient) -> Option<f64>| {
        path.iter().filter_map(|(flops, own)| Some((*flops, of(own)?))).collect::<Vec<_>>()
    };
    panel.line(scene, &along(|own| Some(own.value)), stroke);
    panel.line(scene, &along(|own| Some(own.ci95?[0])), stroke.dash(Dash::Dashed));
    panel.line(scene, &along(|own| Some(own.ci95?[1])), stroke.dash(Dash::Dashed));
    for (minimum, _) in minima(laws) {
        panel.mark(scene, (minimum.budget_flops, (quantity.of)(minimum)), look.mark());
    }
}
