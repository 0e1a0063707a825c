//! A fit in words, for a terminal: on one screen here, and in full.

mod full;

pub use full::summary;

use crate::laws::text::count;
use crate::laws::{
    Advice, AdviceKind, Answer, Doubt, Exponent, IntervalPart, LawKind, Laws, MinimumFlag,
    NoiseSource, PowerLaw, Score, Sensitivity, Validated, Validation, ValidationKind, flags_text,
    student_t95,
};
use crate::words::{from_to, known, listed, thousandths, wrap};

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
    let minima = minima.map_or(String::new(), with_interval);
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

// Consistency of the laws, their errors on unseen budgets, and runs to add.

/// Two values of γ, or of an exponent by two methods, that differ by more than this disagree.
const DISAGREEMENT: f64 = 0.1;

/// γ, the exponent of N_v in N_nv, both ways (as the ratio of the exponents in C, and by the direct fit,
/// ScaMo Eq. 10); kinds of minimum that disagree; and every flagged minimum of the laws' kind.
pub fn verdict(laws: &Laws) -> Vec<String> {
    let said = [gamma(laws), methods_disagree(laws)];
    said.into_iter().flatten().chain(flagged(laws)).collect()
}

/// An exponent with its interval.
pub fn with_interval(law: &PowerLaw) -> String {
    let interval = law.exponent_ci95.map(|ends| format!(" ({})", from_to(ends, thousandths)));
    thousandths(law.exponent) + &interval.unwrap_or_default()
}

fn gamma(laws: &Laws) -> Option<String> {
    let (vocab, nonvocab) =
        (laws.power_laws.params_vocab.as_ref()?, laws.power_laws.params_nonvocab.as_ref()?);
    let direct = laws.told_vocab_from_nonvocab()?;
    let ratio = vocab.exponent / nonvocab.exponent;
    let judgement = if (ratio - direct.exponent).abs() > DISAGREEMENT {
        "the two disagree, so quote neither alone"
    } else if ratio.min(direct.exponent) > 1.0 {
        "the vocabulary should grow faster than the model"
    } else {
        "the vocabulary need not grow faster than the model"
    };
    Some(format!(
        "N_v grows as N_nv^{ratio:.3} by the ratio of the exponents in C, and as N_nv^{} by the \
        direct fit (Eq. 10): {judgement}.",
        with_interval(direct)
    ))
}

/// The two kinds of minimum whose exponents of N_nv lie furthest apart, if they disagree.
fn methods_disagree(laws: &Laws) -> Option<String> {
    let of_size = |r: &Sensitivity| r.exponent_nonvocab.or(r.exponent_params);
    let rows = laws.sensitivity.iter();
    let known = || rows.clone().filter_map(|r| Some((of_size(r)?, r.variant.as_str())));
    let (low, low_name) = known().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let (high, high_name) = known().max_by(|a, b| a.0.total_cmp(&b.0))?;
    (high - low > DISAGREEMENT).then(|| {
        format!(
            "The exponent of {} depends on a choice: {low:.3} ({low_name}) against {high:.3} \
             ({high_name}).",
            laws.parameters.size()
        )
    })
}

fn flagged(laws: &Laws) -> impl Iterator<Item = String> {
    let own = laws.minima.iter().filter(|m| m.method == laws.minima_method);
    own.filter(|m| !m.flags.is_empty()).map(|m| {
        let reasons: Vec<_> = m.flags.iter().map(|flag| reason(*flag)).collect();
        let is_fitted = laws.fitted_budgets.contains(&m.budget_flops);
        let fitted = if is_fitted { "used" } else { "not used" };
        format!(
            "Budget {} ({}, {fitted}): {}.",
            count(m.budget_flops),
            flags_text(&m.flags),
            reasons.join("; ")
        )
    })
}

fn reason(flag: MinimumFlag) -> &'static str {
    match flag {
        MinimumFlag::NotBracketed => {
            "the best model is the smallest or largest tried, so add sizes on that side"
        }
        MinimumFlag::NotConvex => "the loss has no minimum in the model size",
        MinimumFlag::WeakCurvature => "the curve is flat within its noise, so add sizes or seeds",
        MinimumFlag::FewLevels => "too few model sizes for a curve",
        MinimumFlag::VocabNotBracketed => {
            "the best vocabulary is the smallest or largest tried, so add vocabularies on that side"
        }
        MinimumFlag::EdgeVocab => {
            "a size next to the minimum is best with the smallest or largest vocabulary tried"
        }
        MinimumFlag::LackOfFit => "the curve misses the runs by more than their noise",
        MinimumFlag::BelowRuns => {
            "the curve lies further below the best run than noise allows, so it is not used"
        }
        MinimumFlag::Gap => "the sizes on either side are more than a factor 2.5 apart",
        MinimumFlag::DepthChange => "the models on either side differ in depth",
    }
}

/// The errors on budgets that were left out of the fit; empty if there are none.
pub fn unseen_budgets(laws: &Laws) -> String {
    if laws.validation.is_empty() {
        return String::new();
    }
    let head = format!(
        "\n{:<27}{:>8}{:>9}{:>9}{:>9}{:>9}{:>9}\n",
        "unseen budgets, pred./meas.",
        "n",
        "log err",
        "floor",
        laws.parameters.size(),
        "N_v",
        "D"
    );
    head + &laws.validation.iter().map(unseen).collect::<String>()
}

fn unseen(row: &Validation) -> String {
    let kind = match row.kind {
        ValidationKind::LeaveOneOut => "left out",
        ValidationKind::RollForward => "from smaller",
    };
    let ratio = |x: Option<f64>| known(x, thousandths);
    format!(
        "{kind:<16}{:>11}{:>8}{:>+9.4}{:>9}{:>9}{:>9}{:>9}\n",
        count(row.budget_flops),
        row.n_fitted,
        row.log_error,
        known(row.floor_error, |x| format!("{x:+.4}")),
        ratio(row.params_nonvocab_ratio.or(row.params_ratio)),
        ratio(row.params_vocab_ratio),
        ratio(Some(row.tokens_ratio)),
    )
}

/// Runs to add, one item per advice; empty if there is none.
pub fn advice(laws: &Laws) -> String {
    let mut text = listed("what to run next", laws.advice.iter().map(advised));
    if laws.from_sweep && !text.is_empty() {
        let file =
            "--next FILE writes this as a sweep, with models and codebooks that can be built.";
        text += &wrap("  ", file);
    }
    text
}

fn advised(advice: &Advice) -> String {
    let what = match advice.kind {
        AdviceKind::AddSizes => "add sizes",
        AdviceKind::AddVocabularies => "add vocabularies",
        AdviceKind::AddSeeds => "add seeds",
        AdviceKind::LargerBudget => "add this budget",
        AdviceKind::NextBudget => "the next budget, if any",
    };
    let list = |values: &[f64], number: fn(f64) -> String| {
        values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(", ")
    };
    let vocabularies = match &advice.n_vocab[..] {
        [] => String::new(),
        tried => format!("; V {}", list(tried, |x| format!("{x:.0}"))),
    };
    format!(
        "{} FLOPs, {what}: {}. Sizes {}{vocabularies}: {} runs, {} FLOPs.",
        count(advice.budget_flops),
        advice.why,
        list(&advice.params_nonvocab, count),
        advice.runs,
        count(advice.flops),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{Minimum, scamo};

    #[test]
    fn the_published_gammas_are_given_both_ways_and_called_inconsistent() {
        let sentences = verdict(&scamo()).join("\n");
        assert!(sentences.contains("N_nv^1.316"), "{sentences}");
        assert!(sentences.contains("N_nv^1.467"), "{sentences}");
        assert!(sentences.contains("disagree"), "{sentences}");
    }

    #[test]
    fn every_flagged_minimum_is_named() {
        let mut laws = scamo();
        let minimum = |budget_flops, flags| Minimum {
            method: laws.minima_method,
            budget_flops,
            flops: budget_flops,
            params_nonvocab: 1.0,
            params_vocab: 1.0,
            n_vocab: 1.0,
            tokens: 1.0,
            loss_normalised: -1.0,
            ci95: None,
            trusted: false,
            flags,
        };
        laws.minima = vec![
            minimum(1e15, vec![MinimumFlag::VocabNotBracketed]),
            minimum(3e15, vec![]),
            minimum(1e16, vec![MinimumFlag::NotBracketed, MinimumFlag::WeakCurvature]),
        ];
        let sentences = verdict(&laws);
        let naming = |budget: &str| sentences.iter().filter(|s| s.contains(budget)).count();
        assert_eq!([naming("1e15"), naming("3e15"), naming("1e16")], [1, 0, 1], "{sentences:?}");
    }
}
