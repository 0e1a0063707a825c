//! The fit on one screen: the law, its formula, the exponents, and what is in doubt.

use super::{intervals, verdict};
use crate::laws::text::count;
use crate::laws::{Answer, Doubt, Exponent, LawKind, Laws, PowerLaw, Score, Validated};
use crate::words::number::{from_to, thousandths};
use crate::words::wrap;

/// The answer in some fifteen lines of at most 80 columns; [`summary`](super::full::summary()) goes on from it.
pub fn brief(laws: &Laws) -> String {
    let answer = laws.answer();
    let head = [scope(laws), law(laws).unwrap_or_default(), answer.formula.clone()];
    let head: String = head.iter().filter(|s| !s.is_empty()).map(|s| wrap("", s)).collect();
    head + &table(laws, &answer) + &wrap("", &answer.verdict) + &notes(laws, &answer)
}

fn scope(laws: &Laws) -> String {
    let runs = match (laws.parametric.as_ref(), laws.judgement.tried.as_ref()) {
        (Some(parametric), _) => format!("{} runs, ", parametric.n),
        (None, Some(tried)) if tried.runs > 0 => {
            format!("{} runs at {} budgets, ", tried.runs, tried.n_budgets)
        }
        _ => String::new(),
    };
    match laws.law {
        LawKind::Published => format!("{}: published, rule {}.", laws.name, laws.flops_rule),
        _ => {
            let [low, high] = laws.range().map(count);
            format!("{}: {runs}{low} to {high} FLOPs, rule {}.", laws.name, laws.flops_rule)
        }
    }
}

/// The law to believe, and how far each that could be tested missed the held-out budgets.
fn law(laws: &Laws) -> Option<String> {
    let Some(own) = &laws.judgement.recommended else {
        return match laws.law {
            LawKind::Approach1 => Some("Law: the running minimum of the loss (approach 1).".into()),
            _ => None,
        };
    };
    let minima = laws.answer().method.map(|method| format!(" through the {method} minima"));
    let name = own.law.about().to_string() + &minima.unwrap_or_default();
    if own.scores.is_empty() {
        return Some(format!("Law: {name}; {}.", own.why));
    }
    let missed = |score: &Score| format!("{} {:.4}", score.law.name(), score.rms);
    let all: Vec<String> = own.scores.iter().map(missed).collect();
    Some(format!(
        "Law: {name}, best of those tested on held-out budgets (r.m.s. off: {}).",
        all.join(", ")
    ))
}

/// The exponents of the answer, and beside them those of the laws through minima, where these are others.
fn table(laws: &Laws, answer: &Answer) -> String {
    let beside = answer.method.is_none() && laws.power_laws.tokens.is_some();
    let beside = beside && laws.law == LawKind::Isoflop;
    let head = if beside { format!("by minima ({})", laws.minima_method) } else { String::new() };
    let mut out = format!("{:<12}{:>9}{:>19}  {head}", "exponent", "", "95 % interval");
    out = out.trim_end().to_string() + "\n";
    for (name, exponent) in answer.exponents.named() {
        let other = laws.power_laws.of(name).filter(|_| beside);
        out += &row(name, exponent, other);
    }
    out
}

fn row(name: &str, exponent: &Exponent, minima: Option<&PowerLaw>) -> String {
    let name = format!("{name:<4} in C");
    let Some(value) = exponent.value else {
        let reason = exponent.reason.as_deref().unwrap_or("unknown");
        return wrap("", &format!("{name}   not determined: {reason}"));
    };
    let interval = exponent.ci95.map_or("-".into(), |ends| from_to(ends, thousandths));
    let minima = minima.map_or(String::new(), verdict::exponent);
    let line = format!("{name:<12}{value:>9.3}{interval:>19}  {minima}");
    line.trim_end().to_string() + "\n"
}

fn notes(laws: &Laws, answer: &Answer) -> String {
    let doubts = answer.doubts.iter().map(Doubt::sentence);
    let held = forecasts_held(&laws.judgement.validations);
    let all = doubts.chain(held).chain(intervals::sentence(laws));
    all.map(|sentence| wrap("- ", &sentence)).collect()
}

/// One sentence for the forecasts that held.
fn forecasts_held(validations: &[Validated]) -> Option<String> {
    let held = validations.iter().filter(|one| one.inside.is_whole() && one.sentence().is_some());
    match &held.collect::<Vec<_>>()[..] {
        [] => None,
        [one] => one.sentence(),
        several => Some(together(several)),
    }
}

fn together(held: &[&Validated]) -> String {
    let told = held.iter().filter_map(|one| {
        let [low, high] = one.predicted.loss_ci95?;
        let budget = count(one.budget_flops);
        Some(format!("{:.3} ({low:.3} to {high:.3}) at {budget}", one.measured.loss))
    });
    let told: Vec<String> = told.collect();
    format!("{} forecasts held, L_u measured (95 % forecast): {}.", held.len(), told.join(", "))
}
