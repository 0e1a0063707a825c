//! Makes an [`Answer`] from laws: the exponents of the optimum or the reason why there are none, the optimum along
//! the fitted budgets, and the coefficients of the loss; by `say`, the formula, doubts and verdict as text.

use std::collections::BTreeMap;

use crate::laws::file::{
    Answer, Coefficient, Exponent, HeldOutError, LawKind, Laws, OptimumAt, Tried,
};
use crate::laws::input::{MinimumMethod, PerQuantity};
use crate::laws::joint::{JointLaw, JointLoss};
use crate::laws::lines::{LawSample, PowerLaw};
use crate::laws::maths::stats::{Normals, interval95};
use crate::laws::minima::{Optimum, tell_laws};
use crate::laws::ranking::{Candidate, Miss};
use crate::laws::say::{Beyond, Told, Undetermined, doubts, formula, verdict};

impl Laws {
    /// The answer; made here for an older file without one.
    pub fn answer(&self) -> Answer {
        self.answer.clone().unwrap_or_else(|| self.own_answer())
    }

    /// The same for another amount of data: what the joint law with repetition says where `unique_tokens` are
    /// distinct, whichever law is the one to believe, since the others know no data but their own. None
    /// without such a law.
    pub fn on_data(&self, unique_tokens: f64) -> Option<Self> {
        let mut laws = self.clone();
        let joint = laws.judgement.joint.as_ref().filter(|law| law.tells_repetition())?;
        laws.judgement.joint = Some(joint.on_data(unique_tokens));
        laws.judgement.tried.as_mut()?.unique_tokens = Some(unique_tokens);
        let recommended = laws.judgement.recommended.as_mut()?;
        recommended.law = Candidate::JointRepeats;
        recommended.scores.retain(|score| score.law == Candidate::JointRepeats);
        Some(laws.answered())
    }

    /// The laws with their answer, which follows from all else that they hold.
    pub fn answered(mut self) -> Self {
        self.answer = Some(self.own_answer());
        self
    }

    fn own_answer(&self) -> Answer {
        let found = found(self);
        let undetermined: Vec<(&str, Undetermined)> =
            found.named().filter_map(|(name, own)| Some((name, own.why?))).collect();
        let exponents = found.map(|own| own.told(self.range()));
        let doubts = doubts(self, &exponents, &undetermined);
        let (symbol, coefficients) = (self.loss_symbol(), coefficients(self));
        Answer {
            law: self.own_law().to_string(),
            method: self.own_method(),
            why: self.judgement.recommended.as_ref().map_or_else(String::new, |r| r.why.clone()),
            formula: formula(self, symbol, &coefficients),
            coefficients,
            loss_unit: self.metric.unit().unwrap_or("as given").to_string(),
            verdict: verdict(self, !exponents.is_undetermined(), &doubts),
            path: path(self),
            exponents,
            held_out: self.misses(),
            doubts,
        }
    }

    fn own_law(&self) -> &'static str {
        match self.law {
            LawKind::Isoflop => self.recommended_law().name(),
            other => other.name(),
        }
    }

    /// The minima that the recommended law goes through.
    fn own_method(&self) -> Option<MinimumMethod> {
        let lines = matches!(self.recommended_law(), Candidate::Log | Candidate::Floor);
        (self.law == LawKind::Isoflop && lines).then_some(self.minima_method)
    }

    fn misses(&self) -> Vec<HeldOutError> {
        let scores = self.judgement.recommended.iter().flat_map(|r| &r.scores);
        let of = |law: Candidate, miss: &Miss| HeldOutError {
            law: law.name().to_string(),
            budget_flops: miss.budget_flops,
            n_fitted: miss.n_fitted,
            error: miss.loss.by,
        };
        scores.flat_map(|score| score.compared().map(move |miss| of(score.law, miss))).collect()
    }
}

// How the optimum grows with the budget, by the recommended law.

/// The error of a smooth form in the optimum, as a standard deviation in logarithms; it moves each end of the
/// budgets independently (`docs/coverage.md`).
const FORM: f64 = 0.015;
/// Keeps the stream of these draws apart from others.
const FORM_STREAM: u64 = 1 << 41;
/// Largest factor between an optimum and the range tried for its exponent to count as determined.
const BEYOND: f64 = 2.0;
/// An exponent whose 95 % interval is wider than this is not determined.
const WIDEST: f64 = 1.0;

/// An exponent, or why there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Found {
    value: Option<f64>,
    ci95: Option<[f64; 2]>,
    why: Option<Undetermined>,
}

impl Found {
    /// An exponent, unless its interval is too wide or `why` names another reason.
    fn new(value: Option<f64>, ci95: Option<[f64; 2]>, why: Option<Undetermined>) -> Self {
        let wide = value.zip(ci95).filter(|(_, [low, high])| high - low > WIDEST);
        let why = why.or(wide.map(|(value, interval)| Undetermined::Wide(value, interval)));
        Self { value: value.filter(|_| why.is_none()), ci95, why }
    }

    /// As a file has it.
    fn told(&self, range_flops: [f64; 2]) -> Exponent {
        let Self { value, ci95, why } = *self;
        Exponent { value, ci95, range_flops, reason: why.map(Undetermined::sentence) }
    }
}

/// The exponents of the recommended law.
fn found(laws: &Laws) -> PerQuantity<Found> {
    let mut found = match (laws.joint_law(), &laws.judgement.tried) {
        (Some(joint), Some(tried)) => slopes_of_joint(laws, joint, tried),
        _ => slopes_of_power_laws(laws),
    };
    if let Some(vocab) = found.params_vocab.as_mut().filter(|_| laws.judgement.vocab_is_chance) {
        (vocab.value, vocab.why) = (None, vocab.why.or(Some(Undetermined::NoVocabulary)));
    }
    found
}

fn slopes_of_power_laws(laws: &Laws) -> PerQuantity<Found> {
    let told = minima_tell(laws);
    let exponent = |law: Option<&PowerLaw>, why: Undetermined| {
        let law = law.filter(|_| told);
        let none = law.is_none().then_some(why);
        Found::new(law.map(|law| law.exponent), law.and_then(|law| law.exponent_ci95), none)
    };
    let powers = &laws.power_laws;
    let few = match laws.parametric {
        Some(_) => Undetermined::NoOptimum,
        None => Undetermined::FewMinima,
    };
    let vocab = if powers.tokens.is_some() && told { Undetermined::OneVocabulary } else { few };
    let all = PerQuantity {
        params_nonvocab: Some(exponent(powers.size(), few)),
        params_vocab: Some(exponent(powers.params_vocab.as_ref(), vocab)),
        tokens: Some(exponent(powers.tokens.as_ref(), few)),
        ..PerQuantity::default()
    };
    all.under(laws.parameters)
}

/// Whether the minima of the laws determine an exponent; true for laws without minima.
fn minima_tell(laws: &Laws) -> bool {
    let used = laws.own_minima().filter(|m| laws.fitted_budgets.contains(&m.budget_flops));
    laws.law != LawKind::Isoflop || tell_laws(&used.cloned().collect::<Vec<_>>())
}

/// Slopes of the optimum of a joint law between the smallest and the largest budget.
fn slopes_of_joint(laws: &Laws, joint: &JointLaw, tried: &Tried) -> PerQuantity<Found> {
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

// The optimum along the fitted budgets.

/// Budgets of the optimum's path.
const STEPS: usize = 13;

/// From the smallest to the largest fitted budget in equal steps of ln C; empty for a law that was not
/// fitted here.
fn path(laws: &Laws) -> Vec<OptimumAt> {
    let [low, high] = laws.range();
    if laws.law == LawKind::Published || low >= high {
        return Vec::new();
    }
    let at = |i: usize| low * (high / low).powf(i as f64 / (STEPS - 1) as f64);
    let budgets: [f64; STEPS] = std::array::from_fn(at);
    match laws.joint_law() {
        Some(joint) => path_of_joint(laws, joint, budgets),
        None => budgets.iter().map(|budget| path_of_lines(laws, *budget)).collect(),
    }
}

fn path_of_joint(laws: &Laws, joint: &JointLaw, budgets: [f64; STEPS]) -> Vec<OptimumAt> {
    let replicates = joint.optima_at(budgets);
    let told = |i: usize, budget: f64| {
        let own = joint.optimum(budget);
        let all: Vec<Optimum> = replicates.iter().filter_map(|ends| ends[i]).collect();
        let told = |of: fn(&Optimum) -> f64| {
            let value = of(own.as_ref()?);
            let ci95 = interval95(all.iter().map(of));
            value.is_finite().then_some(Coefficient { value, ci95 })
        };
        let loss = own
            .as_ref()
            .map(|own| Coefficient { value: own.loss, ci95: interval95(joint.losses_at(own)) });
        let at = PerQuantity {
            params_nonvocab: told(|o| o.params_nonvocab),
            params_vocab: told(|o| o.params_vocab),
            tokens: told(|o| o.tokens),
            ..PerQuantity::default()
        };
        OptimumAt {
            budget_flops: budget,
            at: at.under(laws.parameters),
            loss: loss.filter(|loss| loss.value.is_finite()),
        }
    };
    budgets.into_iter().enumerate().map(|(i, budget)| told(i, budget)).collect()
}

fn path_of_lines(laws: &Laws, budget: f64) -> OptimumAt {
    let step = (budget / laws.reference_flops).ln();
    let told = |law: Option<&PowerLaw>, of: fn(&LawSample) -> (f64, f64)| {
        let law = law?;
        let at = |(level, exponent): (f64, f64)| (level + exponent * step).exp();
        let all: Vec<f64> = laws.bootstrap.iter().map(|sample| at(of(sample))).collect();
        let value = at((law.ln_at_reference, law.exponent));
        value.is_finite().then(|| Coefficient { value, ci95: interval95(&all) })
    };
    let powers = &laws.power_laws;
    let at = PerQuantity {
        params: told(powers.params.as_ref(), LawSample::size),
        params_nonvocab: told(powers.params_nonvocab.as_ref(), LawSample::size),
        params_vocab: told(powers.params_vocab.as_ref(), LawSample::vocab),
        n_vocab: None,
        tokens: told(powers.tokens.as_ref(), LawSample::tokens),
    };
    let loss = loss_of_lines(laws, budget).filter(|loss| loss.value.is_finite());
    OptimumAt { budget_flops: budget, at, loss }
}

/// By the floor law if it is recommended, or if the laws come from a loss with a floor.
fn loss_of_lines(laws: &Laws, budget: f64) -> Option<Coefficient> {
    let floored = laws.recommended_law() == Candidate::Floor || laws.parametric.is_some();
    let law = if floored || laws.loss.log.is_none() { Candidate::Floor } else { Candidate::Log };
    let value = laws.loss_of_minima(law, budget)?;
    let of = |s: &LawSample| match law {
        Candidate::Log => Some(s.loss_intercept + s.loss_slope_per_decade * budget.log10()),
        _ => Some(s.floor?.loss_at(budget, laws.reference_flops)),
    };
    let all: Vec<f64> = laws.bootstrap.iter().filter_map(of).collect();
    Some(Coefficient { value, ci95: interval95(&all) })
}

// The coefficients of the loss.

/// Coefficients by name; empty if the loss has no law.
fn coefficients(laws: &Laws) -> BTreeMap<String, Coefficient> {
    let named: Vec<(&str, f64, Option<[f64; 2]>)> = match Told::of(laws) {
        None => return BTreeMap::new(),
        Some(Told::Joint(law)) => return coefficients_of_joint(law),
        Some(Told::Parametric(own)) => {
            let values = own.coefficients.values().iter().enumerate();
            let names = own.coefficients.form.names();
            values.map(|(i, value)| (names[i], *value, own.ci95.get(i).copied())).collect()
        }
        Some(Told::Log(law)) => vec![
            ("slope_per_decade", law.slope_per_decade, law.slope_ci95),
            ("intercept", law.intercept, law.intercept_ci95),
        ],
        Some(Told::Floor(law)) => vec![
            ("floor", law.floor, law.floor_ci95),
            ("coefficient", law.coefficient, law.coefficient_ci95),
            ("exponent", law.exponent, law.exponent_ci95),
            ("C0", laws.reference_flops, None),
        ],
    };
    let named = named.into_iter();
    named.map(|(name, value, ci95)| (name.to_string(), Coefficient { value, ci95 })).collect()
}

fn coefficients_of_joint(law: &JointLaw) -> BTreeMap<String, Coefficient> {
    let values =
        |loss: JointLoss| loss.coefficients().into_iter().map(|(_, value)| value).collect();
    let all: Vec<Vec<f64>> = law.bootstrap.iter().map(|own| values(law.loss.with(own))).collect();
    let named = law.loss.coefficients().into_iter().enumerate().map(|(i, (name, value))| {
        let ci95 = interval95(all.iter().map(|values| values[i]));
        (name.to_string(), Coefficient { value, ci95 })
    });
    named.collect()
}
