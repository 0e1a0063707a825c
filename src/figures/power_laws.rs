//! N_nv, N_v and D of the optimum against C, by the law to believe (ScaMo Fig. 7).

use super::colour::LAW;
use super::fitted::{Role, explain_roles, known_minima, law_name, outside_remark, within_reach};
use super::panel::BAND;
use super::quantity::Quantity;
use super::ticks::signed;
use super::{Axis, COMPUTE, Drawing, Legend, Page, Plot, Sample, Scale, Sources, law_stroke};
use crate::laws::{Answer, Laws, Minimum};

pub fn draw(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let minima = known_minima(laws)?;
    let (answer, quantities) = (laws.answer(), sources.quantities());
    let plots = quantities.iter().map(|quantity| quantity.plot(&answer, &minima));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let page = page(sources, laws, &answer, hidden(&quantities, &plots, &minima));
    Ok(page.panels(plots))
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
        let path = self.path(answer);
        points.extend(path.iter().map(|(_, own)| (own.value, Role::Flagged)));
        let x = Axis::new(COMPUTE, Scale::Log, budgets)?;
        let y = Axis::new(self.label, Scale::Log, within_reach(&points))?;
        let mut plot = Plot::new(self.title(answer), x, y);
        plot.law(&path, LAW);
        for (minimum, role) in minima {
            let at = (minimum.budget_flops, (self.of)(minimum));
            plot.mark(at, role.mark(role.colour()));
        }
        Ok(plot)
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
}
