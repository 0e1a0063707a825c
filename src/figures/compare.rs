//! N_nv, N_v and D of several studies' optima against C.

use super::fitted::minima;
use super::quantity::{Quantity, quantities};
use super::{
    Axis, COMPUTE, Drawing, Legend, Look, Page, Plot, Point, Sample, Scale, category_looks,
    law_stroke,
};
use crate::laws::{Coefficient, Laws, Minimum, Parameters};

/// A study: its name and its laws through all budgets.
pub type Study<'a> = (&'a str, &'a Laws);

/// The page, or the reason why there is none.
pub fn draw(studies: &[Study]) -> Drawing {
    let looks = category_looks(studies.len());
    let size_alone = studies.iter().all(|(_, laws)| laws.parameters == Parameters::Total);
    let plots = quantities(size_alone).into_iter().map(|quantity| plot(quantity, studies, &looks));
    let plots = plots.collect::<Result<_, _>>()?;
    Ok(page(studies, &looks).panels(plots))
}

fn page(studies: &[Study], looks: &[Look]) -> Page {
    let mut legend = Legend::default();
    legend.heading("Study");
    for ((name, _), look) in studies.iter().zip(looks) {
        legend.entry(Sample::MarkedLine(law_stroke(look.colour), look.mark()), *name);
    }
    legend.entry(Sample::Line(law_stroke(looks[0].colour).dashed()), "95 % interval");
    let title = "Optimal configurations of several studies".to_string();
    let remarks = "Lines are the optimum by the law that each study recommends, marks the minima."
        .to_string();
    Page { width: 1250.0, height: 440.0, title, remarks, legend }
}

fn plot(quantity: &Quantity, studies: &[Study], looks: &[Look]) -> Result<Plot, String> {
    let points = |laws| -> Vec<Point> {
        let at = |minimum: &Minimum| (minimum.budget_flops, (quantity.of)(minimum));
        minima(laws).into_iter().map(|(minimum, _)| at(minimum)).collect()
    };
    let all: Vec<Point> = studies.iter().flat_map(|(_, laws)| points(laws)).collect();
    if all.is_empty() {
        return Err("no study holds a minimum".to_string());
    }
    let x = Axis::new(COMPUTE, Scale::Log, all.iter().map(|p| p.0))?;
    let y = Axis::new(quantity.label, Scale::Log, all.iter().map(|p| p.1))?;
    let mut plot = Plot::new([], x, y);
    for ((_, laws), look) in studies.iter().zip(looks) {
        let stroke = law_stroke(look.colour);
        let path = quantity.path(&laws.answer());
        let along = |of: fn(&Coefficient) -> Option<f64>| {
            path.iter().filter_map(|(flops, own)| Some((*flops, of(own)?))).collect::<Vec<_>>()
        };
        plot.line(along(|own| Some(own.value)), stroke);
        plot.line(along(|own| Some(own.ci95?[0])), stroke.dashed());
        plot.line(along(|own| Some(own.ci95?[1])), stroke.dashed());
        points(laws).into_iter().for_each(|at| plot.mark(at, look.mark()));
    }
    Ok(plot)
}
