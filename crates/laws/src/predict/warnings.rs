//! The warnings of a prediction.

use super::{Intervals, PredictOptions, Prediction};
use crate::laws::text::{codes, count};
use crate::laws::{Candidate, Laws, Metric, MinimumFlag, Validated};
use crate::predict::allocation::{Vocabulary, shape_for};

/// Laws that spend a budget to within this share count as consistent.
const RATIO_TOLERANCE: f64 = 0.05;
/// A shape or codebook further off than this factor gets a warning.
const MISFIT: f64 = 1.5;

/// All warnings, the heaviest first.
pub(super) fn of(
    prediction: &Prediction,
    laws: &Laws,
    vocabulary: Vocabulary,
    options: &PredictOptions,
) -> Vec<String> {
    let sentences = [
        repetition(prediction, laws),
        sizes_tried(prediction, laws),
        rule(laws, options),
        overspending(prediction),
        unknown_range(laws),
        vocab_edge(laws),
        vocab_range(prediction, laws, vocabulary),
        codebook(prediction),
        shape(prediction, options),
        loss_laws(prediction, laws),
        outside(prediction),
        no_intervals(prediction, laws),
        no_vocabulary(laws, vocabulary),
    ];
    sentences.into_iter().flatten().collect()
}

/// Forecasts that runs have refuted.
pub(super) fn missed(validations: &[Validated], metric: &Metric) -> Option<String> {
    let missed = validations.iter().filter(|one| one.inside.loss == Some(false));
    let told = missed.filter_map(|one| {
        let off = one.predicted.loss? - one.measured.loss;
        let off = metric.said(&format!("{off:+.3}"));
        Some(format!("for {} FLOPs by {off}", count(one.budget_flops)))
    });
    let told: Vec<String> = told.collect();
    (!told.is_empty()).then(|| {
        format!("Earlier forecasts of this sweep missed the measured loss: {}.", told.join(", "))
    })
}

fn rule(laws: &Laws, options: &PredictOptions) -> Option<String> {
    let counted = options.flop_count.rule;
    (counted != laws.flops_rule).then(|| {
        format!(
            "The laws are in {} FLOPs, but the prediction counts by {counted}.",
            laws.flops_rule
        )
    })
}

/// Passes over the data above which repeats are worth less than fresh data.
const REPEATED: f64 = 1.5;
/// Largest factor beyond the sizes and vocabularies tried without a warning.
const BEYOND_TRIED: f64 = 2.0;

/// A warning if the prediction repeats the data more often than the runs that its law is fitted to.
fn repetition(prediction: &Prediction, laws: &Laws) -> Option<String> {
    let unique = laws.judgement.tried?.unique_tokens?;
    let epochs = prediction.at.tokens? / unique;
    let law = laws.recommended_law();
    let most = match law.is_joint() {
        true => laws.judgement.tried?.epochs?,
        // A law of minima is fitted to its minima alone.
        false => laws.own_minima().map(|minimum| minimum.tokens).fold(0.0, f64::max) / unique,
    };
    let joint = laws.judgement.joint.as_ref().filter(|joint| joint.tells_repetition());
    let other = prediction.raw.loss_joint.filter(|_| joint.is_some() && !law.is_joint());
    let so = other.map_or(": expect a higher loss".to_string(), |loss| {
        format!("; the joint law, which models repeats, predicts {loss:.3}")
    });
    (epochs > most.max(REPEATED))
        .then(|| format!("D is {epochs:.1} passes over the data (fit: {most:.1}){so}."))
}

/// A warning if N_nv or V lies far outside the range tried.
fn sizes_tried(prediction: &Prediction, laws: &Laws) -> Option<String> {
    let tried = laws.judgement.tried?;
    let size = *prediction.at.size()?;
    let far_size = is_far(size, tried.sizes).then(|| {
        let [low, high] = tried.sizes.map(count);
        let name = if prediction.at.params.is_some() { "model size" } else { "N_nv =" };
        format!("{name} {} ({low} to {high})", count(size))
    });
    let far_vocab = prediction.at.n_vocab.filter(|v| is_far(*v, tried.vocabularies)).map(|v| {
        let [low, high] = tried.vocabularies;
        format!("V = {} ({low:.0} to {high:.0})", codes(v))
    });
    let far: Vec<String> = [far_size, far_vocab].into_iter().flatten().collect();
    (!far.is_empty()).then(|| format!("Far outside the range tried: {}.", far.join(", ")))
}

pub(super) fn is_far(value: f64, [low, high]: [f64; 2]) -> bool {
    high > 0.0 && !(low / BEYOND_TRIED..=high * BEYOND_TRIED).contains(&value)
}

fn overspending(prediction: &Prediction) -> Option<String> {
    let ratio = prediction.budget_ratio;
    let scale = prediction.at.tokens? / prediction.raw.at.tokens?;
    let what = if ratio > 1.0 { "overspend" } else { "underspend" };
    let (size, tokens) = match prediction.at.params {
        Some(_) => ("model size", "tokens"),
        None => ("N_nv, N_v", "D"),
    };
    ((ratio - 1.0).abs() > RATIO_TOLERANCE).then(|| {
        let factor = ratio.max(1.0 / ratio);
        format!("The separate laws {what} the budget by a factor {factor:.2}; {size} and {tokens} are scaled by {scale:.3} each.")
    })
}

fn unknown_range(laws: &Laws) -> Option<String> {
    let known = !laws.fitted_budgets.is_empty() || laws.judgement.tried.is_some();
    (!known).then(|| {
        format!(
            "{} does not say which budgets it was fitted to; the extrapolation factor counts from {} FLOPs.",
            laws.name,
            count(laws.reference_flops)
        )
    })
}

fn vocab_edge(laws: &Laws) -> Option<String> {
    let edges =
        laws.own_minima().filter(|m| m.flags.contains(&MinimumFlag::VocabNotBracketed)).count();
    (edges > 0).then(|| {
        format!(
            "At {edges} of {} budgets the best vocabulary was the smallest or largest tried: the \
             optimum of N_v lies at the edge of the grid.",
            laws.own_minima().count()
        )
    })
}

/// A warning if V lies outside the span of the sweep's minima by more than a factor [`MISFIT`].
fn vocab_range(prediction: &Prediction, laws: &Laws, vocabulary: Vocabulary) -> Option<String> {
    if let Vocabulary::Fixed(n_vocab) = vocabulary {
        return Some(format!(
            "The runs tried one vocabulary, so V stays at {n_vocab:.0} and nothing is known of \
             the optimal N_v."
        ));
    }
    let own = laws.own_minima().map(|m| m.n_vocab);
    let (low, high) = own.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let v = prediction.at.n_vocab?;
    // If V is far outside the range tried, `sizes_tried` warns already.
    let tried = laws.judgement.tried.is_none_or(|tried| !is_far(v, tried.vocabularies));
    (tried && high > 0.0 && !(low / MISFIT..=high * MISFIT).contains(&v)).then(|| {
        let v = codes(v);
        format!("V = {v} lies outside the optima of the fit, which span {low:.0} to {high:.0}.")
    })
}

fn codebook(prediction: &Prediction) -> Option<String> {
    let (wanted, built) = (prediction.at.n_vocab?, prediction.shape.as_ref()?.n_vocab as f64);
    ((wanted / built).ln().abs() > MISFIT.ln()).then(|| {
        format!(
            "The nearest codebook that can be built has {built:.0} codes instead of V = {}: its N_v is {:.2} \
            times the optimal one.",
            codes(wanted),
            built / wanted
        )
    })
}

fn shape(prediction: &Prediction, options: &PredictOptions) -> Option<String> {
    let wanted = prediction.at.params_nonvocab?;
    let built = shape_for(wanted, options.shapes).ok()?.params_nonvocab() as f64;
    ((wanted / built).ln().abs() > MISFIT.ln()).then(|| {
        format!(
            "The nearest shape that can be built has N_nv = {} instead of {}.",
            count(built),
            count(wanted)
        )
    })
}

/// A warning if a sweep's laws have no vocabulary; a table of N alone needs none.
fn no_vocabulary(laws: &Laws, vocabulary: Vocabulary) -> Option<String> {
    (vocabulary == Vocabulary::None && laws.from_sweep).then(|| {
        "The laws cover model size alone, so neither a vocabulary nor a shape is predicted.".into()
    })
}

/// A warning if the floor law was closer to the loss of the held-out budget than the log law.
fn loss_laws(prediction: &Prediction, laws: &Laws) -> Option<String> {
    if laws.recommended_law() != Candidate::Log {
        return None;
    }
    let (log, floor) = (prediction.raw.loss_log?, prediction.raw.loss_floor?);
    let log_error = laws.loss.log.as_ref()?.held_out_error?;
    let floor_error = laws.loss.floor.as_ref().filter(|law| !law.is_at_bound())?.held_out_error?;
    (floor_error.abs() < log_error.abs()).then(|| {
        format!(
            "The loss {log:.3} comes from the log law; the floor law, whose error at the held-out budget \
            is smaller ({floor_error:+.3} against {log_error:+.3}), gives {floor:.3}."
        )
    })
}

/// A loss that the replicates of its own fit do not hold.
fn outside(prediction: &Prediction) -> Option<String> {
    let (loss, [low, high]) = (prediction.loss_normalised?, prediction.ci95.loss_normalised?);
    (loss < low || loss > high).then(|| {
        format!(
            "The loss {loss:.3} lies outside its own interval, {low:.3} to {high:.3}: the replicates of this \
             fit say otherwise. Look for runs that are far off (--outliers spline)."
        )
    })
}

/// A joint law has replicates of its own.
fn no_intervals(prediction: &Prediction, laws: &Laws) -> Option<String> {
    (prediction.ci95 == Intervals::default())
        .then(|| format!("{} has no bootstrap replicates, so there are no intervals.", laws.name))
}
