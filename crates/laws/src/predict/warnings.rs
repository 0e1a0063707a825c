//! The sentences a prediction owes its reader.

use super::{Intervals, PredictOptions, Prediction};
use crate::laws::text::count;
use crate::laws::{Candidate, Laws, Metric, MinimumFlag, Validated};
use crate::predict::allocation::{Vocabulary, shape_for};

/// Laws that spend a budget to within this share count as consistent.
const RATIO_TOLERANCE: f64 = 0.05;
/// A shape or codebook further off than this factor is no match.
const MISFIT: f64 = 1.5;

/// Everything that makes the prediction less than it seems, the weightiest first.
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
        format!("Forecasts of this sweep have missed what was then measured: {}.", told.join(", "))
    })
}

fn rule(laws: &Laws, options: &PredictOptions) -> Option<String> {
    let counted = options.flop_count.rule;
    (counted != laws.flops_rule).then(|| {
        format!(
            "The laws are written in {} FLOPs, but the projection counts by {counted}.",
            laws.flops_rule
        )
    })
}

/// Passes over the data from which they are worth less than as much fresh data.
const REPEATED: f64 = 1.5;
/// How far beyond the sizes and vocabularies tried a prediction goes unremarked.
const BEYOND_TRIED: f64 = 2.0;

/// Where the prediction repeats the sweep's data more than what its law is fitted to did.
fn repetition(prediction: &Prediction, laws: &Laws) -> Option<String> {
    let unique = laws.judgement.tried?.unique_tokens?;
    let epochs = prediction.at.tokens? / unique;
    let law = laws.recommended_law();
    let most = match law.is_joint() {
        true => laws.judgement.tried?.epochs?,
        // A law of minima knows no other runs.
        false => laws.own_minima().map(|minimum| minimum.tokens).fold(0.0, f64::max) / unique,
    };
    let joint = laws.judgement.joint.as_ref().filter(|joint| joint.tells_repetition());
    let other = prediction.raw.loss_joint.filter(|_| joint.is_some() && !law.is_joint());
    let so = other.map_or(": expect a higher loss".to_string(), |loss| {
        format!("; the joint law knows them: {loss:.3}")
    });
    (epochs > most.max(REPEATED))
        .then(|| format!("D is {epochs:.1} passes over the data (fit: {most:.1}){so}."))
}

/// Where N_nv or V lies far beyond what was tried.
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
        format!("V = {v:.0} ({low:.0} to {high:.0})")
    });
    let far: Vec<String> = [far_size, far_vocab].into_iter().flatten().collect();
    (!far.is_empty()).then(|| format!("Far outside what was tried: {}.", far.join(", ")))
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
        format!("The laws {what} by a factor {factor:.2}; {size} and {tokens} are scaled by {scale:.3} each.")
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

/// Where V leaves what the sweep's own minima span, by more than their widest step would.
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
    // Where V was hardly tried at all, the first sentence has it.
    let tried = laws.judgement.tried.is_none_or(|tried| !is_far(v, tried.vocabularies));
    (tried && high > 0.0 && !(low / MISFIT..=high * MISFIT).contains(&v)).then(|| {
        format!("V = {v:.0} lies outside the optima of the fit, which span {low:.0} to {high:.0}.")
    })
}

fn codebook(prediction: &Prediction) -> Option<String> {
    let (wanted, built) = (prediction.at.n_vocab?, prediction.shape.as_ref()?.n_vocab as f64);
    ((wanted / built).ln().abs() > MISFIT.ln()).then(|| {
        format!(
            "The nearest codebook that can be built has {built:.0} codes, for V = {wanted:.0}: its \
             N_v is {:.2} times the optimum's.",
            built / wanted
        )
    })
}

fn shape(prediction: &Prediction, options: &PredictOptions) -> Option<String> {
    let wanted = prediction.at.params_nonvocab?;
    let built = shape_for(wanted, options.shapes).ok()?.params_nonvocab() as f64;
    ((wanted / built).ln().abs() > MISFIT.ln()).then(|| {
        format!(
            "The nearest shape that can be built has N_nv = {}, for {}.",
            count(built),
            count(wanted)
        )
    })
}

/// Of a sweep, whose models have both; a table of N holds no doubt in that.
fn no_vocabulary(laws: &Laws, vocabulary: Vocabulary) -> Option<String> {
    (vocabulary == Vocabulary::None && laws.from_sweep).then(|| {
        "The laws are of model size alone, so neither a vocabulary nor a shape is predicted.".into()
    })
}

/// Where the floor law, judged by the held-out budget, is the better guide to the loss.
fn loss_laws(prediction: &Prediction, laws: &Laws) -> Option<String> {
    if laws.recommended_law() != Candidate::Log {
        return None;
    }
    let (log, floor) = (prediction.raw.loss_log?, prediction.raw.loss_floor?);
    let log_error = laws.loss.log.as_ref()?.held_out_error?;
    let floor_error = laws.loss.floor.as_ref().filter(|law| !law.is_at_bound())?.held_out_error?;
    (floor_error.abs() < log_error.abs()).then(|| {
        format!(
            "The loss {log:.3} is the log law's; the floor law, which was nearer at the held-out \
             budget ({floor_error:+.3} against {log_error:+.3}), gives {floor:.3}."
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
        .then(|| format!("{} holds no bootstrap, so there are no intervals.", laws.name))
}
