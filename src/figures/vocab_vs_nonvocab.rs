//! N_v against N_nv of the minima, with the law of ScaMo Eq. 10 (ScaMo Fig. 3a).

use super::colour::{INK, LAW, SECOND_LAW};
use super::fitted::{Role, explain_roles, known_minima, minima, outside_remark, within_reach};
use super::series::explain_budgets;
use super::ticks::signed;
use super::{
    Axis, Drawing, Legend, Look, Page, Plot, Point, Sample, Scale, Sources, law_stroke,
    ordered_looks,
};
use crate::laws::{Laws, Minimum};

pub fn draw(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let laws = sources.laws()?;
    let minima = known_minima(laws)?;
    let budgets = budgets(&minima);
    let looks = ordered_looks(budgets.len());
    let mut plot = plot(&minima)?;
    draw_laws(&mut plot, laws);
    for (minimum, role) in minima {
        let place = budgets.iter().position(|&budget| budget == minimum.budget_flops);
        let look = looks[place.expect("the budgets are those of the minima")];
        plot.mark(point(minimum), role.mark(look.colour));
    }
    Ok(page(sources, laws, &plot, (&budgets, &looks)).panels(vec![plot]))
}

fn page(sources: &Sources, laws: &Laws, plot: &Plot, (budgets, looks): (&[f64], &[Look])) -> Page {
    let mut legend = Legend::default();
    explain_laws(&mut legend, laws);
    explain_roles(&mut legend, laws, |_| INK);
    let patch = |look: Look| Sample::Band(look.colour);
    explain_budgets(&mut legend, budgets, looks, sources.held_out_budget(), patch);
    let hidden = minima(laws).iter().filter(|(own, _)| !plot.holds(point(own))).count();
    let remarks = "Nᵥ = V·d, of the best configuration at each budget.".to_owned();
    let remarks = remarks + &outside_remark(hidden);
    let title = sources.title("optimal vocabulary and non-vocabulary parameters");
    Page { width: 1000.0, height: 620.0, title, remarks, legend }
}

fn plot(minima: &[(&Minimum, Role)]) -> Result<Plot, String> {
    let reach = |of: fn(&Minimum) -> f64| {
        within_reach(&minima.iter().map(|(minimum, role)| (of(minimum), *role)).collect::<Vec<_>>())
    };
    let x = reach(|minimum| minimum.params_nonvocab);
    let y = reach(|minimum| minimum.params_vocab);
    let x = Axis::new("Non-vocabulary parameters Nₙᵥ", Scale::Log, x)?;
    Ok(Plot::new([], x, Axis::new("Vocabulary parameters Nᵥ", Scale::Log, y)?))
}

/// N_v at N_nv where both follow their laws in C: its exponent is a/b, not the γ of Eq. 10.
fn implied(laws: &Laws) -> Option<(f64, impl Fn(f64) -> f64)> {
    let vocab = laws.power_laws.params_vocab.as_ref()?;
    let nonvocab = laws.power_laws.params_nonvocab.as_ref()?;
    let gamma = vocab.exponent / nonvocab.exponent;
    let (ln_vocab, ln_nonvocab) = (vocab.ln_at_reference, nonvocab.ln_at_reference);
    Some((gamma, move |params: f64| (ln_vocab + gamma * (params.ln() - ln_nonvocab)).exp()))
}

fn draw_laws(plot: &mut Plot, laws: &Laws) {
    if let Some((_, law)) = implied(laws) {
        plot.curve(plot.x.ends(), law, law_stroke(SECOND_LAW).dashed());
    }
    if let Some(law) = &laws.vocab_from_nonvocab {
        plot.curve(plot.x.ends(), |params| law.value_at(params), law_stroke(LAW));
    }
}

fn explain_laws(legend: &mut Legend, laws: &Laws) {
    legend.heading("Nᵥ ∝ Nₙᵥ to the power γ");
    if let Some(law) = &laws.vocab_from_nonvocab {
        let text = format!("fitted: γ = {}", signed(law.exponent, 3));
        legend.entry(Sample::Line(law_stroke(LAW)), text);
    }
    if let Some((gamma, _)) = implied(laws) {
        let sample = Sample::Line(law_stroke(SECOND_LAW).dashed());
        legend.entry(sample, format!("laws in C: a/b = {}", signed(gamma, 3)));
    }
}

fn budgets(minima: &[(&Minimum, Role)]) -> Vec<f64> {
    let mut budgets: Vec<_> = minima.iter().map(|(minimum, _)| minimum.budget_flops).collect();
    budgets.sort_unstable_by(f64::total_cmp);
    budgets.dedup();
    budgets
}

fn point(minimum: &Minimum) -> Point {
    (minimum.params_nonvocab, minimum.params_vocab)
}
