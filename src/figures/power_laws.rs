//! N_nv, N_v and D of the optimum against C, with their power laws (ScaMo Fig. 7).

use crate::laws::{Laws, Minimum};

use super::axis::{Axis, Scale};
use super::colour::LAW;
use super::fitted::{Role, explain_roles, minima, outside_remark, power, within_reach};
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::quantity::Quantity;
use super::scene::Scene;
use super::series::law_stroke;
use super::ticks::signed;
use super::{Drawing, Sources};

const BAND: f64 = 0.16;

pub fn draw(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let minima = minima(laws);
    if minima.is_empty() {
        return Err("the laws hold no minimum".to_owned());
    }
    let quantities = sources.quantities();
    let plots = quantities.iter().map(|quantity| quantity.plot(laws, &minima));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let page = page(sources, laws, hidden(&quantities, &plots, &minima));
    let (mut scene, panels) = page.panels(plots);
    for (quantity, panel) in quantities.iter().zip(&panels) {
        quantity.draw(&mut scene, panel, laws, &minima);
    }
    Ok(scene)
}

fn page(sources: &Sources, laws: &Laws, hidden: usize) -> Page {
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Laws (Eq. 9)");
    legend.entry(Sample::Line(law_stroke(LAW)), "power law");
    if !laws.bootstrap.is_empty() {
        legend.entry(Sample::Band(LAW.tint(BAND)), "95 % interval");
    }
    let remarks =
        format!("FLOPs counted by the {} rule.{}", laws.flops_rule, outside_remark(hidden));
    let title = sources.title("power laws of the optimal configuration");
    Page { width: 1250.0, height: 460.0, title, remarks, legend }
}

/// How many minima lie outside at least one panel.
fn hidden(quantities: &[&Quantity], plots: &[Plot], minima: &[(&Minimum, Role)]) -> usize {
    let outside = |minimum: &Minimum| {
        quantities.iter().zip(plots).any(|(quantity, plot)| !plot.y.holds((quantity.of)(minimum)))
    };
    minima.iter().filter(|(minimum, _)| outside(minimum)).count()
}

impl Quantity {
    fn plot(&self, laws: &Laws, minima: &[(&Minimum, Role)]) -> Result<Plot, String> {
        let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
        let mut points: Vec<_> =
            minima.iter().map(|(minimum, role)| ((self.of)(minimum), *role)).collect();
        // The law is shown too, but does not stretch the axis by more than a flagged point may.
        let law = (self.law)(laws);
        let on_law = |(minimum, _): &(&Minimum, Role)| Some(power(law?, minimum.budget_flops));
        points.extend(minima.iter().filter_map(on_law).map(|value| (value, Role::Flagged)));
        Ok(Plot {
            title: self.title(laws),
            x: Axis::new("Training compute C (FLOPs)", Scale::Log, budgets)?,
            y: Axis::new(self.label, Scale::Log, within_reach(&points))?,
        })
    }

    fn title(&self, laws: &Laws) -> Vec<String> {
        let Some(law) = (self.law)(laws) else {
            return vec![self.form.to_owned(), "not identified".to_owned()];
        };
        let exponent = format!("{}, {} = {}", self.form, self.exponent, signed(law.exponent, 3));
        let interval = law.exponent_ci95.map_or("no interval".to_owned(), |[low, high]| {
            format!("95 % interval {} to {}", signed(low, 3), signed(high, 3))
        });
        let r2 = law.told_r2().map_or_else(String::new, |r2| format!(", R² = {r2:.3}"));
        vec![exponent, interval + &r2]
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, laws: &Laws, minima: &[(&Minimum, Role)]) {
        let law = (self.law)(laws);
        if law.is_some() && !laws.bootstrap.is_empty() {
            panel.band(scene, |flops| self.interval(laws, flops), LAW.tint(BAND));
        }
        panel.backdrop(scene);
        if let Some(law) = law {
            let ends = (panel.x.value(0.0), panel.x.value(1.0));
            panel.curve(scene, ends, |flops| power(law, flops), law_stroke(LAW));
        }
        for (minimum, role) in minima {
            let at = (minimum.budget_flops, (self.of)(minimum));
            panel.mark(scene, at, role.mark(role.colour()));
        }
    }
}
