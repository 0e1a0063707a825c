//! N_nv, N_v and D of the optimum against C, by the law to believe (ScaMo Fig. 7).

use crate::laws::{Answer, Laws, Minimum};

use super::axis::{Axis, Scale};
use super::colour::LAW;
use super::fitted::{Role, explain_roles, law_name, minima, outside_remark, within_reach};
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
    let (answer, quantities) = (laws.answer(), sources.quantities());
    let plots = quantities.iter().map(|quantity| quantity.plot(&answer, &minima));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let page = page(sources, laws, &answer, hidden(&quantities, &plots, &minima));
    let (mut scene, panels) = page.panels(plots);
    for (quantity, panel) in quantities.iter().zip(&panels) {
        quantity.draw(&mut scene, panel, &answer, &minima);
    }
    Ok(scene)
}

fn page(sources: &Sources, laws: &Laws, answer: &Answer, hidden: usize) -> Page {
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Law");
    legend.entry(Sample::Line(law_stroke(LAW)), law_name(laws));
    if answer.exponents.named().any(|(_, exponent)| exponent.ci95.is_some()) {
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
    fn plot(&self, answer: &Answer, minima: &[(&Minimum, Role)]) -> Result<Plot, String> {
        let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
        let mut points: Vec<_> =
            minima.iter().map(|(minimum, role)| ((self.of)(minimum), *role)).collect();
        // The law is shown too, but does not stretch the axis by more than a flagged point may.
        points.extend(self.path(answer).iter().map(|(_, own)| (own.value, Role::Flagged)));
        Ok(Plot {
            title: self.title(answer),
            x: Axis::new("Training compute C (FLOPs)", Scale::Log, budgets)?,
            y: Axis::new(self.label, Scale::Log, within_reach(&points))?,
        })
    }

    fn title(&self, answer: &Answer) -> Vec<String> {
        let told = self.exponent_of(answer).and_then(|own| Some((own.value?, own.ci95)));
        let Some((value, ci95)) = told else {
            return vec![self.form.to_owned(), "not determined".to_owned()];
        };
        let exponent = format!("{}, {} = {}", self.form, self.exponent, signed(value, 3));
        let interval = ci95.map_or("no interval".to_owned(), |[low, high]| {
            format!("95 % interval {} to {}", signed(low, 3), signed(high, 3))
        });
        vec![exponent, interval]
    }

    fn draw(&self, scene: &mut Scene, panel: &Panel, answer: &Answer, minima: &[(&Minimum, Role)]) {
        let path = self.path(answer);
        panel.ribbon(scene, &path, LAW.tint(BAND));
        panel.backdrop(scene);
        let line: Vec<(f64, f64)> = path.iter().map(|(flops, own)| (*flops, own.value)).collect();
        panel.line(scene, &line, law_stroke(LAW));
        for (minimum, role) in minima {
            let at = (minimum.budget_flops, (self.of)(minimum));
            panel.mark(scene, at, role.mark(role.colour()));
        }
    }
}
