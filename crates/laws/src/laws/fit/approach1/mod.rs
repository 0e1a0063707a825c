//! Approach 1: the laws through the running minimum of the loss (Hoffmann et al. 2022).
//!
//! Runs of one configuration that were measured at several C are a training curve, whose loss is
//! interpolated in ln C; of all curves and single runs the lowest loss seen up to each C is kept,
//! and the laws go through the configurations that hold it. It needs no declared budgets, but it
//! trusts single runs: the lowest of many noisy losses is a lucky one.

pub(in crate::laws) mod frontier;
#[cfg(test)]
mod tests;

pub use frontier::FrontierPoint;

use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::fit::fill;
use crate::laws::fit::unfitted::unfitted;
use crate::laws::input::check;
use crate::laws::input::error::FitError;
use crate::laws::input::options::FitOptions;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::lines::law_set::{Columns, LawSet, law_set};
use crate::laws::lines::types::PowerLaw;
use crate::laws::maths::random::below;
use crate::laws::maths::stats::{distinct, geometric_mean, interval95};
use crate::laws::say::warnings;
use frontier::Candidates;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

/// The laws through the frontier, with intervals from drawing curves anew.
///
/// # Errors
/// [`FitError`]: wrong values, or a frontier of fewer than three sizes.
pub fn approach1(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    check::metric(points)?;
    points.iter().try_for_each(|p| check::point(p, options.parameters))?;
    let candidates = Candidates::new(points, true);
    let front = candidates.lowest(&vec![true; candidates.n_curves]);
    let reference = geometric_mean(front.iter().map(|p| p.flops));
    let sizes = sizes(&front);
    let fitted = through(&front, reference, options).filter(|_| sizes >= LEAST_SIZES);
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
fn replicates(candidates: &Candidates, reference: f64, options: &FitOptions) -> Vec<LawSet> {
    let one = |i: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(i as u64);
        let mut chosen = vec![false; candidates.n_curves];
        for _ in 0..candidates.n_curves {
            chosen[below(&mut rng, candidates.n_curves)] = true;
        }
        through(&candidates.lowest(&chosen), reference, options)
    };
    let all: Vec<Option<LawSet>> = (0..options.bootstrap).into_par_iter().map(one).collect();
    all.into_iter().flatten().collect()
}

/// The laws through one frontier, N_v's only if it holds several vocabularies; None for fewer than three points.
fn through(front: &[FrontierPoint], reference: f64, options: &FitOptions) -> Option<LawSet> {
    let column = |of: fn(&FrontierPoint) -> f64| front.iter().map(of).collect::<Vec<f64>>();
    let columns = Columns {
        compute: column(|p| p.flops),
        params_vocab: column(|p| p.params_vocab),
        params_nonvocab: column(|p| p.params_nonvocab),
        tokens: column(|p| p.tokens),
        loss: column(|p| p.loss),
        weights: vec![1.0; front.len()],
    };
    let several = front.iter().any(|p| p.n_vocab != front[0].n_vocab);
    let set = law_set(&columns, reference, options).filter(|_| front.len() >= 3)?;
    let of_vocab = |law: Option<PowerLaw>| law.filter(|_| several);
    Some(LawSet {
        params_vocab: of_vocab(set.params_vocab),
        vocab_from_nonvocab: of_vocab(set.vocab_from_nonvocab),
        ..set
    })
}

fn laws(
    points: &[IsoFlopPoint],
    front: &[FrontierPoint],
    mut set: LawSet,
    replicates: &[LawSet],
    options: &FitOptions,
) -> Laws {
    let names = (options.name.as_str(), options.flops_rule.as_str());
    let mut laws = unfitted(LawKind::Approach1, names, options.parameters, set.reference, points);
    let law = |law: PowerLaw, of: fn(&LawSet) -> Option<&PowerLaw>| PowerLaw {
        exponent_ci95: interval(replicates, |set| Some(of(set)?.exponent)),
        ln_at_reference_ci95: interval(replicates, |set| Some(of(set)?.ln_at_reference)),
        log10_coefficient_ci95: interval(replicates, |set| Some(of(set)?.log10_coefficient)),
        ..law
    };
    set.params_nonvocab = law(set.params_nonvocab, |set| Some(&set.params_nonvocab));
    set.params_vocab = set.params_vocab.map(|v| law(v, |set| set.params_vocab.as_ref()));
    set.tokens = law(set.tokens, |set| Some(&set.tokens));
    let of_vocab = |v| law(v, |set| set.vocab_from_nonvocab.as_ref());
    set.vocab_from_nonvocab = set.vocab_from_nonvocab.map(of_vocab);
    set.log.slope_ci95 = interval(replicates, |set| Some(set.log.slope_per_decade));
    fill(&mut laws, set, true);
    laws.bootstrap = replicates.iter().filter_map(LawSet::sample).collect();
    laws.warnings = sentences(points, front, options);
    laws.answered()
}

fn interval(replicates: &[LawSet], of: impl Fn(&LawSet) -> Option<f64>) -> Option<[f64; 2]> {
    interval95(replicates.iter().filter_map(of))
}

fn sentences(
    points: &[IsoFlopPoint],
    front: &[FrontierPoint],
    options: &FitOptions,
) -> Vec<String> {
    let mut sentences = vec![warnings::of_frontier(front.len(), points.len())];
    let one_vocabulary = points.iter().all(|p| p.n_vocab == points[0].n_vocab);
    if options.parameters == Parameters::Split && one_vocabulary {
        sentences.push(warnings::ONE_VOCABULARY.to_string());
    }
    sentences
}
