//! How the optimum grows with the budget, by the law to believe.

use crate::laws::file::answer::Exponent;
use crate::laws::file::judgement::Tried;
use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::quantities::PerQuantity;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::types::PowerLaw;
use crate::laws::maths::random::Normals;
use crate::laws::maths::stats::interval95;
use crate::laws::minima::select::tell_laws;
use crate::laws::minima::types::Optimum;
use crate::laws::say::reasons::{Beyond, Undetermined};

/// How well a smooth form places an optimum, as a standard deviation in logarithms: it moves either end of the
/// budgets for itself (`docs/coverage.md`).
const FORM: f64 = 0.015;
/// Keeps the stream of these draws apart from others.
const FORM_STREAM: u64 = 1 << 41;
/// How far beyond the sizes and vocabularies tried an optimum may lie for its exponent to be told.
const BEYOND: f64 = 2.0;
/// An exponent whose 95 % interval is wider than this is not determined.
const WIDEST: f64 = 1.0;

/// An exponent, or why there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct Found {
    value: Option<f64>,
    ci95: Option<[f64; 2]>,
    pub why: Option<Undetermined>,
}

impl Found {
    /// An exponent that its interval tells, unless it is known beforehand `why` there is none.
    fn new(value: Option<f64>, ci95: Option<[f64; 2]>, why: Option<Undetermined>) -> Self {
        let wide = value.zip(ci95).filter(|(_, [low, high])| high - low > WIDEST);
        let why = why.or(wide.map(|(value, interval)| Undetermined::Wide(value, interval)));
        Self { value: value.filter(|_| why.is_none()), ci95, why }
    }

    /// As a file has it.
    pub fn told(&self, range_flops: [f64; 2]) -> Exponent {
        let Self { value, ci95, why } = *self;
        Exponent { value, ci95, range_flops, reason: why.map(Undetermined::sentence) }
    }
}

/// Of the law to believe.
pub(super) fn of(laws: &Laws) -> PerQuantity<Found> {
    match (laws.joint_law(), &laws.judgement.tried) {
        (Some(joint), Some(tried)) => of_joint(laws, joint, tried),
        _ => of_power_laws(laws),
    }
}

fn of_power_laws(laws: &Laws) -> PerQuantity<Found> {
    let told = minima_tell(laws);
    let exponent = |law: Option<&PowerLaw>, why: Undetermined| {
        let law = law.filter(|_| told);
        let none = law.is_none().then_some(why);
        Found::new(law.map(|law| law.exponent), law.and_then(|law| law.exponent_ci95), none)
    };
    let (powers, few) = (&laws.power_laws, Undetermined::FewMinima);
    let vocab = if powers.tokens.is_some() && told { Undetermined::OneVocabulary } else { few };
    let all = PerQuantity {
        params_nonvocab: Some(exponent(powers.size(), few)),
        params_vocab: Some(exponent(powers.params_vocab.as_ref(), vocab)),
        tokens: Some(exponent(powers.tokens.as_ref(), few)),
        ..PerQuantity::default()
    };
    all.under(laws.parameters)
}

/// Whether the minima that the laws go through tell an exponent; laws that go through none do.
fn minima_tell(laws: &Laws) -> bool {
    let used = laws.own_minima().filter(|m| laws.fitted_budgets.contains(&m.budget_flops));
    laws.law != LawKind::Isoflop || tell_laws(&used.cloned().collect::<Vec<_>>())
}

/// Slopes of the optimum of a joint law between the smallest and the largest budget.
fn of_joint(laws: &Laws, joint: &JointLaw, tried: &Tried) -> PerQuantity<Found> {
    let [low, high] = laws.range();
    let ends = |at: [Option<Optimum>; 2]| Some([at[0]?, at[1]?]);
    let own = ends([low, high].map(|budget| joint.optimum(budget)));
    let replicates: Vec<[Optimum; 2]> =
        joint.optima_at([low, high]).into_iter().filter_map(ends).collect();
    let slope = |ends: &[Optimum; 2], of: fn(&Optimum) -> f64| {
        (of(&ends[1]) / of(&ends[0])).ln() / (high / low).ln()
    };
    let of_form = FORM * 2f64.sqrt() / (high / low).ln();
    let exponent = |of: fn(&Optimum) -> f64, why: Option<Undetermined>| {
        let slopes = replicates.iter().map(|ends| slope(ends, of));
        let mut normals = Normals::of_stream(0, FORM_STREAM);
        let slopes: Vec<f64> = slopes.map(|slope| slope + of_form * normals.draw()).collect();
        let value = own.as_ref().map(|ends| slope(ends, of)).filter(|value| value.is_finite());
        let none = value.is_none().then_some(Undetermined::NoOptimum);
        Some(Found::new(value, interval95(&slopes), why.or(none)))
    };
    let beyond = |of: fn(&Optimum) -> f64, tried| beyond(own.as_ref()?, of, tried);
    let size = beyond(|o| o.params_nonvocab, tried.sizes).map(Undetermined::BeyondSizes);
    let one = (!joint.loss.terms.vocab).then_some(Undetermined::OneVocabulary);
    let vocab = beyond(|o| o.n_vocab.unwrap_or_default(), tried.vocabularies)
        .map(Undetermined::BeyondVocabularies);
    let all = PerQuantity {
        params_nonvocab: exponent(|o| o.params_nonvocab, size),
        params_vocab: exponent(|o| o.params_vocab, one.or(vocab)),
        tokens: exponent(|o| o.tokens, size),
        ..PerQuantity::default()
    };
    all.under(laws.parameters)
}

/// An optimum of the fitted budgets that lies far from all that was tried.
fn beyond(ends: &[Optimum; 2], of: fn(&Optimum) -> f64, [low, high]: [f64; 2]) -> Option<Beyond> {
    let optimum = ends.iter().map(of).find(|x| *x < low / BEYOND || *x > high * BEYOND)?;
    Some(Beyond { optimum, tried: if optimum < low { low } else { high } })
}
