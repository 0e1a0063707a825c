//! N_v against N_nv of the minima, with the law of ScaMo Eq. 10 (ScaMo Fig. 3a).

use crate::laws::{Laws, Minimum};

use super::axis::{Axis, Scale};
use super::colour::{INK, LAW, SECOND_LAW};
use super::fitted::{Role, explain_roles, minima, outside_remark, power, within_reach};
use super::legend::{Legend, Sample};
use super::page::{Page, Plot};
use super::panel::Panel;
use super::scene::{Dash, Scene};
use super::series::{Look, explain_budgets, law_stroke, ordered_looks};
use super::ticks::signed;
use super::{Drawing, Sources};

pub fn draw(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let laws = sources.laws()?;
    let minima = minima(laws);
    if minima.is_empty() {
        return Err("the laws hold no minimum".to_owned());
    }
    let budgets = budgets(&minima);
    let looks = ordered_looks(budgets.len());
    let plot = plot(&minima)?;
    let page = page(sources, laws, &plot, (&budgets, &looks));
    let (mut scene, panels) = page.panels(vec![plot]);
    panels[0].backdrop(&mut scene);
    draw_laws(&mut scene, &panels[0], laws);
    for (minimum, role) in minima {
        let place = budgets.iter().position(|&budget| budget == minimum.budget_flops);
        let look = looks[place.expect("the budgets are those of the minima")];
        panels[0].mark(&mut scene, point(minimum), role.mark(look.colour));
    }
    Ok(scene)
}

fn page(sources: &Sources, laws: &Laws, plot: &Plot, (budgets, looks): (&[f64], &[Look])) -> Page {
    let mut legend = Legend::default();
    explain_laws(&mut legend, laws);
    explain_roles(&mut legend, laws, |_| INK);
    let patch = |look: Look| Sample::Band(look.colour);
    explain_budgets(&mut legend, budgets, looks, sources.held_out_budget(), patch);
    let minima = minima(laws);
    let shown = |minimum: &Minimum| {
        plot.x.holds(minimum.params_nonvocab) && plot.y.holds(minimum.params_vocab)
    };
    let hidden = minima.iter().filter(|(minimum, _)| !shown(minimum)).count();
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
    Ok(Plot {
        title: Vec::new(),
        x: Axis::new("Non-vocabulary parameters Nₙᵥ", Scale::Log, x)?,
        y: Axis::new("Vocabulary parameters Nᵥ", Scale::Log, y)?,
    })
}

/// N_v at N_nv where both follow their laws in C: its exponent is a/b, not the γ of Eq. 10.
fn implied(laws: &Laws) -> Option<(f64, impl Fn(f64) -> f64)> {
    let vocab = laws.power_laws.params_vocab.as_ref()?;
    let nonvocab = laws.power_laws.params_nonvocab.as_ref()?;
    let gamma = vocab.exponent / nonvocab.exponent;
    let (ln_vocab, ln_nonvocab) = (vocab.ln_at_reference, nonvocab.ln_at_reference);
    Some((gamma, move |params: f64| (ln_vocab + gamma * (params.ln() - ln_nonvocab)).exp()))
}

fn draw_laws(scene: &mut Scene, panel: &Panel, laws: &Laws) {
    let ends = (panel.x.value(0.0), panel.x.value(1.0));
    if let Some((_, law)) = implied(laws) {
        panel.curve(scene, ends, law, law_stroke(SECOND_LAW).dash(Dash::Dashed));
    }
    if let Some(law) = &laws.vocab_from_nonvocab {
        panel.curve(scene, ends, |params| power(law, params), law_stroke(LAW));
    }
}

fn explain_laws(legend: &mut Legend, laws: &Laws) {
    legend.heading("Nᵥ ∝ Nₙᵥ to the power γ");
    if let Some(law) = &laws.vocab_from_nonvocab {
        let text = format!("fitted: γ = {}", signed(law.exponent, 3));
        legend.entry(Sample::Line(law_stroke(LAW)), text);
    }
    if let Some((gamma, _)) = implied(laws) {
        let sample = Sample::Line(law_stroke(SECOND_LAW).dash(Dash::Dashed));
        legend.entry(sample, format!("laws in C: a/b = {}", signed(gamma, 3)));
    }
}

fn budgets(minima: &[(&Minimum, Role)]) -> Vec<f64> {
    let mut budgets: Vec<_> = minima.iter().map(|(minimum, _)| minimum.budget_flops).collect();
    budgets.sort_unstable_by(f64::total_cmp);
    budgets.dedup();
    budgets
}

fn point(minimum: &Minimum) -> (f64, f64) {
    (minimum.params_nonvocab, minimum.params_vocab)
}
