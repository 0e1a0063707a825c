//! Consistency of the laws, their errors on unseen budgets, and runs to add.

use crate::laws::text::count;
use crate::laws::{
    Advice, AdviceKind, Laws, MinimumFlag, PowerLaw, Sensitivity, Validation, ValidationKind,
    flags_text,
};
use crate::words::{from_to, known, listed, thousandths, wrap};

/// Two values of γ, or of an exponent by two methods, that differ by more than this disagree.
const DISAGREEMENT: f64 = 0.1;

/// γ, the exponent of N_v in N_nv, both ways (as the ratio of the exponents in C, and by the direct fit,
/// ScaMo Eq. 10); kinds of minimum that disagree; and every flagged minimum of the laws' kind.
pub fn verdict(laws: &Laws) -> Vec<String> {
    let said = [gamma(laws), methods_disagree(laws)];
    said.into_iter().flatten().chain(flagged(laws)).collect()
}

/// An exponent with its interval.
pub fn exponent(law: &PowerLaw) -> String {
    let interval = law.exponent_ci95.map(|ends| format!(" ({})", from_to(ends, thousandths)));
    thousandths(law.exponent) + &interval.unwrap_or_default()
}

fn gamma(laws: &Laws) -> Option<String> {
    let (vocab, nonvocab) =
        (laws.power_laws.params_vocab.as_ref()?, laws.power_laws.params_nonvocab.as_ref()?);
    let direct = laws.vocab_from_nonvocab.as_ref()?;
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
        exponent(direct)
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
