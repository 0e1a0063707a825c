//! A fit in words, for a terminal: on one screen here, and in full.

mod full;
mod verdict;

pub use full::summary;

use super::{from_to, thousandths, wrap};
use crate::laws::text::count;
use crate::laws::{
    Answer, Doubt, Exponent, IntervalPart, LawKind, Laws, NoiseSource, PowerLaw, Score, Validated,
    student_t95,
};

/// The answer in some fifteen lines of at most 80 columns: the law, its formula, the exponents and the doubts;
/// [`summary`] continues it.
pub fn brief(laws: &Laws) -> String {
    let answer = laws.answer();
    let head = [scope(laws), law(laws, &answer).unwrap_or_default(), answer.formula.clone()];
    let head: String = head.iter().filter(|s| !s.is_empty()).map(|s| wrap("", s)).collect();
    head + &table(laws, &answer) + &wrap("", &answer.verdict) + &notes(laws, &answer)
}

fn scope(laws: &Laws) -> String {
    let runs = match (&laws.parametric, &laws.judgement.tried) {
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

/// The recommended law, and the error of each tested law on the held-out budgets.
fn law(laws: &Laws, answer: &Answer) -> Option<String> {
    let Some(own) = &laws.judgement.recommended else {
        let running = "Law: the running minimum of the loss (approach 1).";
        return (laws.law == LawKind::Approach1).then(|| running.into());
    };
    let minima = answer.method.map(|method| format!(" through the {method} minima"));
    let name = own.law.about().to_string() + &minima.unwrap_or_default();
    if own.scores.is_empty() {
        return Some(format!("Law: {name}; {}.", own.why));
    }
    let missed = |score: &Score| format!("{} {:.4}", score.law.name(), score.rms);
    let all: Vec<String> = own.scores.iter().map(missed).collect();
    Some(format!("Law: {name}, the best on held-out budgets (r.m.s. error: {}).", all.join(", ")))
}

/// The exponents of the answer; if it is a joint law, also the exponents of the laws through minima.
fn table(laws: &Laws, answer: &Answer) -> String {
    let beside = answer.method.is_none() && laws.power_laws.tokens.is_some();
    let beside = beside && laws.law == LawKind::Isoflop;
    let head = if beside { format!("from minima ({})", laws.minima_method) } else { String::new() };
    let head = format!("{:<12}{:>9}{:>19}  {head}", "exponent", "", "95 % interval");
    let row = |(name, exponent): (&str, &Exponent)| {
        row(name, exponent, laws.power_laws.of(name).filter(|_| beside))
    };
    head.trim_end().to_string() + "\n" + &answer.exponents.named().map(row).collect::<String>()
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
    let all = doubts.chain(held).chain(intervals(laws));
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
    format!(
        "{} forecasts held; L_u measured (95 % interval forecast): {}.",
        held.len(),
        told.join(", ")
    )
}

// The sources of error that the intervals cover.

/// The sources of error in the intervals of the exponents; for laws of minima, with the half-width for N_nv's exponent.
/// `None` without intervals.
fn intervals(laws: &Laws) -> Option<String> {
    if laws.recommended_law().is_joint() {
        return of_joint(laws);
    }
    let of = laws.parameters.size();
    laws.power_laws.of(of)?.exponent_ci95?;
    let parts = laws.judgement.interval_parts.iter();
    let told: Vec<String> = parts.filter_map(|part| told(part, laws)).collect();
    let (told, rest) = (Some(told.join(", ")).filter(|told| !told.is_empty())?, rest(laws));
    Some(format!("Intervals cover, for {of}'s exponent: {told}{rest}."))
}

fn of_joint(laws: &Laws) -> Option<String> {
    let judgement = &laws.judgement;
    let joint = judgement.joint.as_ref().filter(|joint| !joint.bootstrap.is_empty())?;
    let tokenizers = if judgement.tokenizer_noise.is_some() { ", tokenizers" } else { "" };
    let test = if judgement.test_noise.is_some() { ", the test split" } else { "" };
    let cells = format!("the scatter of {} cells (SD {:.3})", joint.n, joint.residual_sd);
    Some(format!("Intervals cover {cells}{tokenizers}{test}{}.", rest(laws)))
}

fn told(part: &IntervalPart, laws: &Laws) -> Option<String> {
    let [low, high] = part.exponent_nonvocab?;
    let by = match laws.noise.map(|noise| noise.source) {
        Some(NoiseSource::Surface { .. }) if part.part == "runs" => {
            " (from a surface; no repeated seeds)"
        }
        _ => "",
    };
    Some(format!("{} ±{:.3}{by}", part.part, (high - low) / 2.0))
}

/// The errors that no interval covers, and the shift that all losses share on other clips.
fn rest(laws: &Laws) -> String {
    let (tokenizers, test) = (&laws.judgement.tokenizer_noise, &laws.judgement.test_noise);
    let missing = match (tokenizers, test) {
        (None, None) if !laws.from_sweep => "; not the settings that all runs share",
        (Some(_), Some(_)) => "",
        (Some(_), None) => "; not the test split",
        (None, Some(_)) => "; not tokenizers (one per vocabulary)",
        (None, None) => "; not the test split or tokenizers (one per vocabulary)",
    };
    let others = test.as_ref().map_or_else(String::new, |noise| {
        let half = student_t95(noise.blocks - 1) * noise.sd;
        format!("; other test clips would shift all losses by ±{half:.2}")
    });
    missing.to_string() + &others
}
