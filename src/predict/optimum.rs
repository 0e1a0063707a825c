//! The prediction itself.

use super::at_budget::{Vocabulary, fitted_at, sample_at, shape_for, width_for};
use super::codebook::Codebook;
use super::{
    Allocation, Intervals, PredictError, PredictOptions, PredictedShape, Prediction, Raw, project,
    warnings,
};
use crate::laws::{Laws, around, interval95};

/// The optimal configuration for `budget` FLOPs.
///
/// The laws are read at C; the values, which rarely spend exactly C, are projected onto it
/// ([`project()`]); the nearest shape of the options and the nearest codebook are chosen. Every interval goes
/// through the same steps, replicate by replicate.
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
    // Laws that bend are read as tangents at C.
    let straightened = laws.law.bends().then(|| around(laws, budget));
    let laws = straightened.as_ref().unwrap_or(laws);
    let vocabulary = Vocabulary::of(laws)?;
    let at_c = fitted_at(laws, vocabulary, options.shapes, budget)?;
    if !at_c.flops(options.flop_count).is_finite() {
        return Err(PredictError::OutOfRange { laws: laws.name.clone(), budget });
    }
    let on_budget = project(&at_c, budget, options.flop_count)?;
    let raw = raw(laws, vocabulary, &at_c, budget, options);
    let (n_vocab, shape) = match vocabulary {
        Vocabulary::None => (None, None),
        _ if !laws.from_sweep => (None, None),
        _ => shape(&on_budget, options).map(|(n_vocab, shape)| (Some(n_vocab), Some(shape)))?,
    };
    let size = Size::of(vocabulary, &on_budget);
    let mut prediction = Prediction {
        budget_flops: budget,
        law: laws.name.clone(),
        params: size.params,
        params_nonvocab: size.params_nonvocab,
        params_vocab: size.params_vocab,
        n_vocab,
        tokens: on_budget.tokens,
        loss_normalised: raw.loss_log.or(raw.loss_floor),
        ci95: intervals(laws, vocabulary, budget, options),
        spends_flops: raw.spends_flops,
        budget_ratio: raw.spends_flops / budget,
        extrapolation_factor: budget / largest_fitted(laws),
        shape,
        warnings: Vec::new(),
        raw,
    };
    prediction.warnings = warnings::of(&prediction, laws, vocabulary, options);
    Ok(prediction)
}

/// An allocation's size under the names of what is known of it.
struct Size {
    params: Option<f64>,
    params_nonvocab: Option<f64>,
    params_vocab: Option<f64>,
}

impl Size {
    fn of(vocabulary: Vocabulary, allocation: &Allocation) -> Self {
        let is_split = vocabulary != Vocabulary::None;
        Self {
            params: (!is_split).then_some(allocation.params_nonvocab),
            params_nonvocab: is_split.then_some(allocation.params_nonvocab),
            params_vocab: is_split.then_some(allocation.params_vocab),
        }
    }
}

fn raw(
    laws: &Laws,
    vocabulary: Vocabulary,
    at_c: &Allocation,
    budget: f64,
    options: &PredictOptions,
) -> Raw {
    let size = Size::of(vocabulary, at_c);
    Raw {
        params: size.params,
        params_nonvocab: size.params_nonvocab,
        params_vocab: size.params_vocab,
        tokens: at_c.tokens,
        spends_flops: at_c.flops(options.flop_count),
        loss_log: laws.loss.log.as_ref().map(|law| law.loss_at(budget)),
        loss_floor: laws.loss.floor.as_ref().map(|law| law.loss_at(budget, laws.reference_flops)),
    }
}

/// V of an allocation in the nearest shape, and that shape with the nearest codebook.
fn shape(
    on_budget: &Allocation,
    options: &PredictOptions,
) -> Result<(f64, PredictedShape), PredictError> {
    let shape = shape_for(on_budget.params_nonvocab, options.shapes)?;
    let n_vocab = on_budget.params_vocab / shape.d_model as f64;
    let codebook = Codebook::near(n_vocab);
    let shape = PredictedShape {
        n_layer: shape.n_layer,
        n_head: shape.n_head,
        d_model: shape.d_model,
        n_vocab: codebook.n_vocab,
        levels: codebook.levels,
    };
    Ok((n_vocab, shape))
}

/// The largest fitted budget; C0 where the laws were not fitted here.
fn largest_fitted(laws: &Laws) -> f64 {
    laws.fitted_budgets.iter().copied().reduce(f64::max).unwrap_or(laws.reference_flops)
}

fn intervals(
    laws: &Laws,
    vocabulary: Vocabulary,
    budget: f64,
    options: &PredictOptions,
) -> Intervals {
    let on_budget = |sample| {
        let at_c = sample_at(sample, laws, vocabulary, options.shapes, budget)?;
        project(&at_c, budget, options.flop_count).ok()
    };
    let replicates: Vec<Allocation> = laws.bootstrap.iter().filter_map(on_budget).collect();
    let interval = |value: &dyn Fn(&Allocation) -> Option<f64>| {
        interval95(&replicates.iter().filter_map(value).collect::<Vec<_>>())
    };
    let loss_floor = floor_interval(laws, budget);
    Intervals {
        params: interval(&|a| Size::of(vocabulary, a).params),
        params_nonvocab: interval(&|a| Size::of(vocabulary, a).params_nonvocab),
        params_vocab: interval(&|a| Size::of(vocabulary, a).params_vocab),
        n_vocab: interval(&|a| {
            let params_vocab = Size::of(vocabulary, a).params_vocab?;
            Some(params_vocab / width_for(a.params_nonvocab, options.shapes).ok()?)
        }),
        tokens: interval(&|a| Some(a.tokens)),
        loss_normalised: log_interval(laws, budget).or(loss_floor),
        loss_floor,
    }
}

/// The interval of the log law's loss.
fn log_interval(laws: &Laws, budget: f64) -> Option<[f64; 2]> {
    laws.loss.log.as_ref()?;
    let losses = laws.bootstrap.iter();
    interval95(
        &losses
            .map(|s| s.loss_intercept + s.loss_slope_per_decade * budget.log10())
            .collect::<Vec<_>>(),
    )
}

/// The interval of the floor law's loss, over the replicates that had one.
fn floor_interval(laws: &Laws, budget: f64) -> Option<[f64; 2]> {
    laws.loss.floor.as_ref()?;
    let floors = laws.bootstrap.iter().filter_map(|sample| sample.floor);
    let losses = floors.map(|floor| floor.loss_at(budget, laws.reference_flops));
    interval95(&losses.collect::<Vec<_>>())
}

#[cfg(test)]
mod tests;
