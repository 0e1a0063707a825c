//! Predicts the optimum of a budget.

use super::{
    Allocation, Intervals, PredictError, PredictOptions, PredictedShape, Prediction, Raw, project,
    warnings,
};
use crate::laws::{
    Candidate, Deviations, LOSS_NORMALISED, LawKind, LawSample, Laws, Optimum, PerQuantity,
    TestNoise, around, interval95,
};
use crate::predict::allocation::{Vocabulary, fitted_at, sample_at, shape_for};
use crate::predict::several::{Spread, opinions, together};
use crate::predict::shapes::Codebook;

/// The optimal configuration for `budget` FLOPs.
///
/// The laws of all budgets are used, the held-out one included. If a joint law is recommended, the allocation is its
/// optimum for the budget. Otherwise the power laws are evaluated at C, and the values, which rarely spend exactly C,
/// are projected onto it ([`project()`]). The nearest shape of the options and the nearest codebook are chosen.
/// Every interval goes through the same steps, replicate by replicate.
///
/// # Errors
/// [`PredictError`].
pub fn predict(
    laws: &Laws,
    budget: f64,
    options: &PredictOptions,
) -> Result<Prediction, PredictError> {
    if !(budget.is_finite() && budget > 0.0) {
        return Err(PredictError::BadBudget(budget));
    }
    let validations = &laws.judgement.validations;
    // Laws that bend are read as tangents at C.
    let straightened = laws.law.bends().then(|| around(laws, budget));
    let laws = straightened.as_ref().unwrap_or(laws);
    let best = Best::at(laws, budget, options)?;
    let Best { vocabulary, on_budget, .. } = best;
    let raw = raw(laws, &best, budget, options);
    let (n_vocab, shape) = match vocabulary {
        Vocabulary::None => (None, None),
        _ if !laws.from_sweep => (None, None),
        _ => shape(laws, &best, options).map(|(v, shape)| (Some(v), Some(shape)))?,
    };
    let loss_normalised = match laws.recommended_law() {
        Candidate::Log => raw.loss_log.or(raw.loss_floor),
        Candidate::Floor => raw.loss_floor,
        Candidate::Joint | Candidate::JointRepeats => raw.loss_joint,
    };
    let own = (loss_normalised.unwrap_or(f64::NAN), on_budget);
    let opinions = opinions(laws, (vocabulary, options), own, budget);
    let factor = budget / laws.range()[1];
    let spread = Spread::new(opinions.clone(), factor);
    let mut prediction = Prediction {
        budget_flops: budget,
        law: laws.name.clone(),
        at: PerQuantity { n_vocab, ..on_budget.named(laws.parameters) },
        loss_normalised,
        loss_name: loss_name(laws),
        recommended: laws.judgement.recommended.as_ref().map(|recommended| recommended.law),
        together: None,
        ci95: intervals(laws, &best, &spread, budget, options),
        spends_flops: raw.spends_flops,
        budget_ratio: raw.spends_flops / budget,
        extrapolation_factor: factor,
        below_fit: below_fit(laws, budget),
        shape,
        warnings: Vec::new(),
        raw,
    };
    prediction.together = together(&prediction, (vocabulary, &on_budget), &opinions, options)?;
    let missed = warnings::missed(validations, &laws.metric);
    let own = warnings::of(&prediction, laws, vocabulary, options);
    prediction.warnings = missed.into_iter().chain(own).collect();
    Ok(prediction)
}

/// The smallest fitted budget over `budget`, if above 1; `None` for a published law, without budgets.
pub(super) fn below_fit(laws: &Laws, budget: f64) -> Option<f64> {
    let factor = laws.range()[0] / budget;
    (factor > 1.0 + 1e-9 && laws.law != LawKind::Published).then_some(factor)
}

/// The name of a loss that is not L_u.
pub(super) fn loss_name(laws: &Laws) -> Option<String> {
    let name = laws.metric.name();
    (name != LOSS_NORMALISED).then(|| name.to_string())
}

/// The optimum of the recommended law at a budget.
#[derive(Clone, Copy)]
struct Best {
    vocabulary: Vocabulary,
    /// By the laws themselves.
    at_c: Allocation,
    /// Spending the budget.
    on_budget: Allocation,
    /// If a joint law is recommended.
    joint: Option<Optimum>,
}

impl Best {
    fn at(laws: &Laws, budget: f64, options: &PredictOptions) -> Result<Self, PredictError> {
        let vocabulary = Vocabulary::of(laws)?;
        let joint = laws.joint_law().and_then(|law| Some((law, law.optimum(budget)?)));
        if let Some((law, joint)) = joint {
            if let Some((what, [low, high])) = law.at_an_end(&joint) {
                let laws = laws.name.clone();
                return Err(PredictError::NoOptimum { laws, budget, what, low, high });
            }
            // Its allocation spends the budget at the prices of the sweep's own models.
            let own = Allocation::from(joint);
            return Ok(Self { vocabulary, at_c: own, on_budget: own, joint: Some(joint) });
        }
        let at_c = fitted_at(laws, vocabulary, options.shapes, budget)?;
        if !at_c.flops(options.flop_count).is_finite() {
            return Err(PredictError::OutOfRange { laws: laws.name.clone(), budget });
        }
        let on_budget = project(&at_c, budget, options.flop_count)?;
        Ok(Self { vocabulary, at_c, on_budget, joint: None })
    }

    /// V, if the laws have it.
    fn n_vocab(&self, options: &PredictOptions) -> Option<f64> {
        let by_width = || self.on_budget.n_vocab(options.shapes);
        self.joint.map_or_else(by_width, |joint| joint.n_vocab).filter(|v| *v > 0.0)
    }
}

fn raw(laws: &Laws, best: &Best, budget: f64, options: &PredictOptions) -> Raw {
    let spends_flops = match best.joint {
        Some(_) => budget,
        None => best.at_c.flops(options.flop_count),
    };
    Raw {
        at: best.at_c.named(laws.parameters),
        spends_flops,
        loss_log: laws.loss_of_minima(Candidate::Log, budget),
        loss_floor: laws.loss_of_minima(Candidate::Floor, budget),
        loss_joint: match best.joint {
            Some(joint) => Some(joint.loss),
            None => laws.judgement.joint.as_ref().and_then(|law| Some(law.optimum(budget)?.loss)),
        },
    }
}

/// V: the only one tried, else by the widths of the sweep's models if a joint law has them, else by the nearest shape;
/// and that shape with the codebook to build.
fn shape(
    laws: &Laws,
    best: &Best,
    options: &PredictOptions,
) -> Result<(f64, PredictedShape), PredictError> {
    let Best { vocabulary, on_budget, joint, .. } = best;
    let shape = shape_for(on_budget.params_nonvocab, options.shapes)?;
    let by_width = on_budget.params_vocab / shape.d_model as f64;
    let n_vocab = match (vocabulary, joint) {
        (Vocabulary::Fixed(only), _) => *only,
        (_, Some(Optimum { n_vocab: Some(own), .. })) => *own,
        _ => by_width,
    };
    let near = Codebook::near(n_vocab);
    let is_fixed = matches!(vocabulary, Vocabulary::Fixed(_)) && near.n_vocab as f64 != n_vocab;
    let codebook = match laws.own_vocabularies || is_fixed {
        true => Codebook::without_levels(n_vocab),
        false => near,
    };
    let shape = PredictedShape {
        n_layer: shape.n_layer,
        n_head: shape.n_head,
        d_model: shape.d_model,
        n_vocab: codebook.n_vocab,
        levels: codebook.levels,
    };
    Ok((n_vocab, shape))
}

/// The interval of every quantity: from the replicates, widened by the other laws and by the errors of past forecasts.
fn intervals(
    laws: &Laws,
    best: &Best,
    spread: &Spread,
    budget: f64,
    options: &PredictOptions,
) -> Intervals {
    let vocabulary = best.vocabulary;
    let joint: Option<Vec<Optimum>> = laws.joint_law().map(|law| law.optima(budget));
    let on_budget = |sample| {
        let at_c = sample_at(sample, laws, vocabulary, options.shapes, budget)?;
        project(&at_c, budget, options.flop_count).ok()
    };
    let replicates: Vec<Allocation> = match &joint {
        Some(optima) => optima.iter().copied().map(Allocation::from).collect(),
        None => laws.bootstrap.iter().filter_map(on_budget).collect(),
    };
    let interval = |value: &dyn Fn(&Allocation) -> Option<f64>, of: fn(&Deviations) -> f64| {
        interval95(spread.of_logs(replicates.iter().filter_map(value), of))
    };
    let floors = laws.bootstrap.iter().filter_map(|sample| sample.floor);
    let floors = floors.map(|floor| floor.loss_at(budget, laws.reference_flops));
    let floor = spread.of(floors, |e| e.loss);
    let loss_floor = interval95(&floor);
    let losses = match laws.recommended_law() {
        Candidate::Log if laws.loss.log.is_some() => {
            let at = |s: &LawSample| s.loss_intercept + s.loss_slope_per_decade * budget.log10();
            spread.of(laws.bootstrap.iter().map(at), |e| e.loss)
        }
        Candidate::Log | Candidate::Floor => floor,
        Candidate::Joint | Candidate::JointRepeats => {
            let at_own = laws.joint_law().zip(best.joint);
            let at_own = at_own.map(|(law, own)| law.losses_at(&own)).unwrap_or_default();
            spread.of(at_own.into_iter(), |e| e.loss)
        }
    };
    let on_other_clips = |noise: &TestNoise| {
        let place = [best.on_budget.params_nonvocab, best.n_vocab(options)?, budget];
        interval95(noise.moved(&losses, place.map(f64::ln)))
    };
    let by_law = vocabulary == Vocabulary::Law;
    let by_width = |a: &Allocation| a.n_vocab(options.shapes);
    let n_vocab = || match &joint {
        Some(optima) => {
            interval95(spread.of_logs(optima.iter().filter_map(|o| o.n_vocab), |e| e.ln_vocab))
        }
        None => interval(&by_width, |e| e.ln_vocab),
    };
    let at = PerQuantity {
        params_nonvocab: interval(&|a| Some(a.params_nonvocab), |e| e.ln_size),
        params_vocab: interval(&|a| Some(a.params_vocab), |e| e.ln_vocab),
        n_vocab: if by_law { n_vocab() } else { None },
        tokens: interval(&|a| Some(a.tokens), |e| e.ln_tokens),
        ..PerQuantity::default()
    };
    Intervals {
        at: at.under(laws.parameters),
        loss_normalised: interval95(&losses),
        loss_on_other_clips: laws.judgement.test_noise.as_ref().and_then(on_other_clips),
        loss_floor,
    }
}
