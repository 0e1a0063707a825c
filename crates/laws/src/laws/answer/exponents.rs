//! How the optimum grows with the budget, by the law to believe.

use super::path::joint;
use crate::laws::file::answer::{Exponent, OwnExponents};
use crate::laws::file::judgement::Tried;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::point::Parameters;
use crate::laws::joint::law::JointLaw;
use crate::laws::joint::optimum::JointOptimum;
use crate::laws::lines::types::PowerLaw;
use crate::laws::maths::random::Normals;
use crate::laws::maths::stats::interval95;
use crate::laws::minima::select::tell_laws;
use crate::laws::words::text::count;

/// How well a smooth form places an optimum, as a standard deviation in logarithms: it moves either end of the
/// budgets for itself (`docs/coverage.md`).
const FORM: f64 = 0.015;
/// Keeps the stream of these draws apart from others.
const FORM_STREAM: u64 = 1 << 41;
/// How far beyond the sizes and vocabularies tried an optimum may lie for its exponent to be told.
const BEYOND: f64 = 2.0;
/// Numbers below are written out.
const WRITTEN_OUT: f64 = 1e5;

/// Of the law to believe.
pub(super) fn of(laws: &Laws) -> OwnExponents {
    match (joint(laws), &laws.judgement.tried) {
        (Some(joint), Some(tried)) => of_joint(laws, joint, tried),
        _ => of_power_laws(laws),
    }
}

fn of_power_laws(laws: &Laws) -> OwnExponents {
    let (range_flops, told) = (laws.range(), minima_tell(laws));
    let exponent = |law: &Option<PowerLaw>, reason: &str| {
        let law = law.as_ref().filter(|_| told);
        let value = law.map(|law| law.exponent);
        let own = Exponent {
            value,
            ci95: law.and_then(|law| law.exponent_ci95),
            range_flops,
            reason: value.is_none().then(|| reason.to_string()),
        };
        Some(own.if_told())
    };
    let powers = &laws.power_laws;
    let split = laws.parameters == Parameters::Split;
    let few = "fewer than three budgets have a minimum of their own";
    let vocab = if powers.tokens.is_some() && told { ONE_VOCABULARY } else { few };
    OwnExponents {
        params: if split { None } else { exponent(&powers.params, few) },
        params_nonvocab: if split { exponent(&powers.params_nonvocab, few) } else { None },
        params_vocab: if split { exponent(&powers.params_vocab, vocab) } else { None },
        tokens: exponent(&powers.tokens, few),
    }
}

/// Whether the minima that the laws go through tell an exponent; laws that go through none do.
fn minima_tell(laws: &Laws) -> bool {
    let own = laws.minima.iter().filter(|m| m.method == laws.minima_method);
    let used = own.filter(|m| laws.fitted_budgets.contains(&m.budget_flops));
    laws.law != LawKind::Isoflop || tell_laws(&used.cloned().collect::<Vec<_>>())
}

const ONE_VOCABULARY: &str = "one vocabulary was tried";

/// Slopes of the optimum of a joint law between the smallest and the largest budget.
fn of_joint(laws: &Laws, joint: &JointLaw, tried: &Tried) -> OwnExponents {
    let [low, high] = laws.range();
    let ends = |at: [Option<JointOptimum>; 2]| Some([at[0]?, at[1]?]);
    let own = ends([low, high].map(|budget| joint.optimum(budget)));
    let replicates: Vec<[JointOptimum; 2]> =
        joint.optima_at([low, high]).into_iter().filter_map(ends).collect();
    let slope = |ends: &[JointOptimum; 2], of: fn(&JointOptimum) -> f64| {
        (of(&ends[1]) / of(&ends[0])).ln() / (high / low).ln()
    };
    let of_form = FORM * 2f64.sqrt() / (high / low).ln();
    let exponent = |of: fn(&JointOptimum) -> f64, reason: Option<String>| {
        let slopes = replicates.iter().map(|ends| slope(ends, of));
        let mut normals = Normals::of_stream(0, FORM_STREAM);
        let slopes: Vec<f64> = slopes.map(|slope| slope + of_form * normals.draw()).collect();
        let value = own.as_ref().map(|ends| slope(ends, of)).filter(|value| value.is_finite());
        let none = value.is_none().then(|| "the law has no optimum".to_string());
        let reason = reason.or(none);
        Exponent {
            value: value.filter(|_| reason.is_none()),
            ci95: interval95(&slopes),
            range_flops: [low, high],
            reason,
        }
        .if_told()
    };
    let split = laws.parameters == Parameters::Split;
    let size_beyond =
        own.and_then(|ends| beyond(&ends, |o| o.params_nonvocab, tried.sizes, "size"));
    let size = exponent(|o| o.params_nonvocab, size_beyond.clone());
    let vocab = || {
        let levels = tried.vocabularies;
        let reason = (!joint.loss.terms.vocab).then(|| ONE_VOCABULARY.to_string());
        let beyond = own.and_then(|ends| beyond(&ends, |o| o.n_vocab, levels, "vocabulary"));
        exponent(|o| o.params_vocab, reason.or(beyond))
    };
    OwnExponents {
        params: (!split).then(|| size.clone()),
        params_nonvocab: split.then_some(size),
        params_vocab: split.then(vocab),
        tokens: Some(exponent(|o| o.tokens, size_beyond)),
    }
}

/// A sentence where an optimum of the fitted budgets lies far from all that was tried.
fn beyond(
    ends: &[JointOptimum; 2],
    of: fn(&JointOptimum) -> f64,
    [low, high]: [f64; 2],
    what: &str,
) -> Option<String> {
    let far = ends.iter().map(of).find(|x| *x < low / BEYOND || *x > high * BEYOND)?;
    let side = if far < low { "smallest" } else { "largest" };
    let tried = if far < low { low } else { high };
    // A vocabulary is a whole number.
    let number = |x: f64| if x < WRITTEN_OUT { format!("{x:.0}") } else { count(x) };
    Some(format!(
        "the optimum, {}, lies far beyond the {side} {what} tried, {}",
        number(far),
        number(tried)
    ))
}
