//! N_nv, N_v and D of the optimum, and of the optima of several studies.

use super::axis::{Axis, COMPUTE, Scale, signed};
use super::cells::{Drawing, Sources, sorted};
use super::fitted::{
    Quantity, Role, explain_roles, interval95, known_minima, law_name, minima, outside_remark,
    quantities, within_reach,
};
use super::legend::{Legend, Look, Sample, category_looks, law_stroke, ordered_looks};
use super::page::Page;
use super::panel::{BAND, Plot};
use super::scene::Point;
use super::style::{INK, LAW, SECOND_LAW};
use crate::laws::{Answer, Coefficient, Laws, Minimum, Parameters};

// Against C.

/// N_nv, N_v and D of the optimum against C, by the recommended law (ScaMo Fig. 7).
pub fn power_laws(sources: &Sources) -> Drawing {
    let laws = sources.laws()?;
    let (minima, answer) = (known_minima(laws)?, laws.answer());
    let quantities = quantities(sources.knows_size_alone());
    let plots = quantities.iter().map(|quantity| power_law(quantity, &answer, &minima));
    let plots = plots.collect::<Result<Vec<_>, _>>()?;
    let mut legend = Legend::default();
    explain_roles(&mut legend, laws, Role::colour);
    legend.heading("Law");
    legend.entry(Sample::Line(law_stroke(LAW)), law_name(laws));
    if answer.exponents.named().any(|(_, exponent)| exponent.ci95.is_some()) {
        legend.entry(Sample::Band(LAW.tint(BAND)), "95 % interval");
    }
    // Minima that lie outside at least one panel.
    let outside = |(minimum, _): &&(&Minimum, Role)| {
        quantities.iter().zip(&plots).any(|(quantity, plot)| !plot.y.holds((quantity.of)(minimum)))
    };
    let remark = outside_remark(minima.iter().filter(outside).count());
    let remarks = format!("FLOPs counted by the {} rule.{remark}", laws.flops_rule);
    let title = sources.title("power laws of the optimal configuration");
    Ok(Page { width: 1250.0, height: 460.0, title, remarks, legend }.panels(plots))
}

fn power_law(
    quantity: &Quantity,
    answer: &Answer,
    minima: &[(&Minimum, Role)],
) -> Result<Plot, String> {
    let budgets = minima.iter().map(|(minimum, _)| minimum.budget_flops);
    let points = minima.iter().map(|(minimum, role)| ((quantity.of)(minimum), *role));
    // The law is shown too, but does not stretch the axis by more than a flagged point may.
    let path = quantity.path(answer);
    let points = points.chain(path.iter().map(|(_, own)| (own.value, Role::Flagged)));
    let x = Axis::new(COMPUTE, Scale::Log, budgets)?;
    let y = Axis::new(quantity.label, Scale::Log, within_reach(&points.collect::<Vec<_>>()))?;
    let mut plot = Plot::new(exponent(quantity, answer), x, y);
    plot.law(&path, LAW);
    for (minimum, role) in minima {
        let at = (minimum.budget_flops, (quantity.of)(minimum));
        plot.mark(at, role.mark(role.colour()));
    }
    Ok(plot)
}

/// The lines above a panel.
fn exponent(quantity: &Quantity, answer: &Answer) -> Vec<String> {
    let told = quantity.exponent_of(answer).and_then(|own| Some((own.value?, own.ci95)));
    let Some((value, ci95)) = told else {
        return vec![quantity.form.to_owned(), "not determined".to_owned()];
    };
    let exponent = format!("{}, {} = {}", quantity.form, quantity.exponent, signed(value, 3));
    vec![exponent, ci95.map_or("no interval".to_owned(), interval95)]
}

// The vocabulary's parameters against the others.

/// N_v against N_nv of the minima, with the law of ScaMo Eq. 10 (ScaMo Fig. 3a).
pub fn vocab_vs_nonvocab(sources: &Sources) -> Drawing {
    sources.needs_vocabulary()?;
    let laws = sources.laws()?;
    let known = known_minima(laws)?;
    let budgets = sorted(known.iter().map(|(minimum, _)| minimum.budget_flops.to_bits()));
    let budgets: Vec<f64> = budgets.into_iter().map(f64::from_bits).collect();
    let looks = ordered_looks(budgets.len());
    let reach = |of: fn(&Minimum) -> f64| {
        within_reach(&known.iter().map(|(minimum, role)| (of(minimum), *role)).collect::<Vec<_>>())
    };
    let x = reach(|minimum| minimum.params_nonvocab);
    let y = reach(|minimum| minimum.params_vocab);
    let x = Axis::new("Non-vocabulary parameters Nₙᵥ", Scale::Log, x)?;
    let y = Axis::new("Vocabulary parameters Nᵥ", Scale::Log, y)?;
    let (mut plot, mut legend) = (Plot::new([], x, y), Legend::default());
    show_laws(&mut plot, &mut legend, laws);
    for (minimum, role) in &known {
        let place = budgets.iter().position(|&budget| budget == minimum.budget_flops);
        let look = looks[place.expect("the budgets are those of the minima")];
        plot.mark(point(minimum), role.mark(look.colour));
    }
    explain_roles(&mut legend, laws, |_| INK);
    let patch = |look: Look| Sample::Band(look.colour);
    legend.budgets(&budgets, &looks, sources.held_out_budget(), patch);
    let outside = outside_remark(known.iter().filter(|(own, _)| !plot.holds(point(own))).count());
    let remarks = format!("Nᵥ = V·d, of the best configuration at each budget.{outside}");
    let title = sources.title("optimal vocabulary and non-vocabulary parameters");
    Ok(Page { width: 1000.0, height: 620.0, title, remarks, legend }.panels(vec![plot]))
}

/// The law of ScaMo Eq. 10, and N_v in N_nv by the laws in C, whose exponent is a/b, not the γ of Eq. 10.
fn show_laws(plot: &mut Plot, legend: &mut Legend, laws: &Laws) {
    let (fitted, implied) = (law_stroke(LAW), law_stroke(SECOND_LAW).dashed());
    legend.heading("Nᵥ ∝ Nₙᵥ to the power γ");
    if let Some(law) = &laws.vocab_from_nonvocab {
        legend.entry(Sample::Line(fitted), format!("fitted: γ = {}", signed(law.exponent, 3)));
    }
    if let (Some(vocab), Some(nonvocab)) =
        (&laws.power_laws.params_vocab, &laws.power_laws.params_nonvocab)
    {
        let gamma = vocab.exponent / nonvocab.exponent;
        let (ln_vocab, ln_nonvocab) = (vocab.ln_at_reference, nonvocab.ln_at_reference);
        let law = |params: f64| (ln_vocab + gamma * (params.ln() - ln_nonvocab)).exp();
        plot.curve(plot.x.ends(), law, implied);
        legend.entry(Sample::Line(implied), format!("laws in C: a/b = {}", signed(gamma, 3)));
    }
    if let Some(law) = &laws.vocab_from_nonvocab {
        plot.curve(plot.x.ends(), |params| law.value_at(params), fitted);
    }
}

fn point(minimum: &Minimum) -> Point {
    (minimum.params_nonvocab, minimum.params_vocab)
}

// Several studies.

/// A study: its name and its laws through all budgets.
type Study<'a> = (&'a str, &'a Laws);

/// N_nv, N_v and D of several studies' optima against C; or the reason why there is no page.
pub fn compare(studies: &[Study]) -> Drawing {
    let looks = category_looks(studies.len());
    let size_alone = studies.iter().all(|(_, laws)| laws.parameters == Parameters::Total);
    let plots =
        quantities(size_alone).iter().map(|quantity| side_by_side(quantity, studies, &looks));
    let plots = plots.collect::<Result<_, _>>()?;
    let mut legend = Legend::headed("Study");
    for ((name, _), look) in studies.iter().zip(&looks) {
        legend.entry(Sample::MarkedLine(law_stroke(look.colour), look.mark()), *name);
    }
    legend.entry(Sample::Line(law_stroke(looks[0].colour).dashed()), "95 % interval");
    let title = "Optimal configurations of several studies".to_owned();
    let remarks = "Lines are the optimum by the law that each study recommends, marks the minima.";
    let remarks = remarks.to_owned();
    Ok(Page { width: 1250.0, height: 440.0, title, remarks, legend }.panels(plots))
}

fn side_by_side(quantity: &Quantity, studies: &[Study], looks: &[Look]) -> Result<Plot, String> {
    let at = |(minimum, _): (&Minimum, Role)| (minimum.budget_flops, (quantity.of)(minimum));
    let points = |laws| minima(laws).into_iter().map(at);
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
        plot.marks(points(laws), *look);
    }
    Ok(plot)
}
