//! Approach 1: the laws through the running minimum of the loss (Hoffmann et al. 2022).
//!
//! Runs of one configuration that were measured at several C are a training curve, whose loss is
//! interpolated in ln C; of all curves and single runs the lowest loss seen up to each C is kept,
//! and the laws go through the configurations that hold it. It needs no declared budgets, but it
//! trusts single runs: the lowest of many noisy losses is a lucky one.

pub(in crate::laws) mod fitted;
pub(in crate::laws) mod frontier;
pub(in crate::laws) mod options;
#[cfg(test)]
mod tests;

pub use frontier::FrontierPoint;
pub use options::Approach1Options;

use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::fit::unfitted::unfitted;
use crate::laws::input::check;
use crate::laws::input::error::FitError;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::lines::sample::{FloorSample, LawSample};
use crate::laws::lines::types::{LogLaw, PowerLaw, PowerLaws};
use crate::laws::maths::random::below;
use crate::laws::maths::stats::{distinct, geometric_mean, interval95};
use crate::laws::say::warnings;
use fitted::Fitted;
use frontier::Candidates;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

/// The laws through the frontier, with intervals from drawing curves anew.
///
/// # Errors
/// [`FitError`]: wrong values, or a frontier of fewer than three sizes.
pub fn approach1(points: &[IsoFlopPoint], options: &Approach1Options) -> Result<Laws, FitError> {
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    check::metric(points)?;
    points.iter().try_for_each(|p| check::point(p, options.parameters))?;
    let candidates = Candidates::new(points, options.interpolate);
    let front = candidates.lowest(&vec![true; candidates.n_curves]);
    let reference = geometric_mean(&front.iter().map(|p| p.flops).collect::<Vec<_>>());
    let sizes = sizes(&front);
    let fitted = Fitted::new(&front, reference, options).filter(|_| sizes >= LEAST_SIZES);
    let fitted = fitted.ok_or_else(|| {
        FitError::NotIdentified(format!(
            "the frontier of the lowest loss holds {sizes} size(s), but its laws need \
             {LEAST_SIZES}; give runs of more sizes and budgets"
        ))
    })?;
    let replicates = replicates(&candidates, reference, options);
    Ok(laws(points, &front, fitted, &replicates, options))
}

/// Sizes on a frontier below which a law of N in C would be that of a grid of one or two.
const LEAST_SIZES: usize = 3;

fn sizes(front: &[FrontierPoint]) -> usize {
    distinct(front.iter().map(|p| p.params_nonvocab)).len()
}

/// Curves drawn with replacement, each time fitted anew; of a curve drawn twice one is enough.
fn replicates(candidates: &Candidates, reference: f64, options: &Approach1Options) -> Vec<Fitted> {
    let one = |i: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(i as u64);
        let mut chosen = vec![false; candidates.n_curves];
        for _ in 0..candidates.n_curves {
            chosen[below(&mut rng, candidates.n_curves)] = true;
        }
        Fitted::new(&candidates.lowest(&chosen), reference, options)
    };
    let all: Vec<Option<Fitted>> = (0..options.bootstrap).into_par_iter().map(one).collect();
    all.into_iter().flatten().collect()
}

fn laws(
    points: &[IsoFlopPoint],
    front: &[FrontierPoint],
    fitted: Fitted,
    replicates: &[Fitted],
    options: &Approach1Options,
) -> Laws {
    let names = (options.name.as_str(), options.flops_rule.as_str());
    let reference = geometric_mean(&front.iter().map(|p| p.flops).collect::<Vec<_>>());
    let mut laws = unfitted(LawKind::Approach1, names, options.parameters, reference, points);
    let law = |law: PowerLaw, of: fn(&Fitted) -> Option<&PowerLaw>| PowerLaw {
        exponent_ci95: interval(replicates, |f| Some(of(f)?.exponent)),
        ln_at_reference_ci95: interval(replicates, |f| Some(of(f)?.ln_at_reference)),
        log10_coefficient_ci95: interval(replicates, |f| Some(of(f)?.log10_coefficient)),
        ..law
    };
    let all = PowerLaws {
        params_nonvocab: Some(law(fitted.nonvocab, |f| Some(&f.nonvocab))),
        params_vocab: fitted.vocab.map(|v| law(v, |f| f.vocab.as_ref())),
        tokens: Some(law(fitted.tokens, |f| Some(&f.tokens))),
        ..PowerLaws::default()
    };
    laws.power_laws = all.under(options.parameters);
    laws.vocab_from_nonvocab =
        fitted.vocab_from_nonvocab.map(|v| law(v, |f| f.vocab_from_nonvocab.as_ref()));
    laws.loss = fitted.loss;
    let slope = |f: &Fitted| f.loss.log.as_ref().map(|l| l.slope_per_decade);
    let slope_ci95 = interval(replicates, slope);
    laws.loss.log = laws.loss.log.map(|law| LogLaw { slope_ci95, ..law });
    laws.bootstrap = replicates.iter().filter_map(sample).collect();
    laws.warnings = sentences(points, front, options);
    laws.answered()
}

fn interval(replicates: &[Fitted], of: impl Fn(&Fitted) -> Option<f64>) -> Option<[f64; 2]> {
    interval95(&replicates.iter().filter_map(of).collect::<Vec<_>>())
}

fn sample(fitted: &Fitted) -> Option<LawSample> {
    let loss = fitted.loss.log.as_ref()?;
    let vocab = |of: fn(&PowerLaw) -> f64| fitted.vocab.as_ref().map_or(0.0, of);
    Some(LawSample {
        ln_vocab_at_reference: vocab(|l| l.ln_at_reference),
        exponent_vocab: vocab(|l| l.exponent),
        ln_nonvocab_at_reference: fitted.nonvocab.ln_at_reference,
        exponent_nonvocab: fitted.nonvocab.exponent,
        ln_tokens_at_reference: fitted.tokens.ln_at_reference,
        exponent_tokens: fitted.tokens.exponent,
        loss_intercept: loss.intercept,
        loss_slope_per_decade: loss.slope_per_decade,
        floor: fitted.loss.floor.as_ref().map(FloorSample::of),
    })
}

fn sentences(
    points: &[IsoFlopPoint],
    front: &[FrontierPoint],
    options: &Approach1Options,
) -> Vec<String> {
    let mut sentences = vec![warnings::of_frontier(front.len(), points.len())];
    let one_vocabulary = points.iter().all(|p| p.n_vocab == points[0].n_vocab);
    if options.parameters == Parameters::Split && one_vocabulary {
        sentences.push(warnings::ONE_VOCABULARY.to_string());
    }
    sentences
}
