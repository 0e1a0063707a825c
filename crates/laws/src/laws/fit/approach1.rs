//! Approach 1: the laws through the running minimum of the loss (Hoffmann et al. 2022).
//!
//! Runs of one configuration that were measured at several C are a training curve, whose loss is
//! interpolated in ln C; of all curves and single runs the lowest loss seen up to each C is kept,
//! and the laws go through the configurations that hold it. It needs no declared budgets, but it
//! trusts single runs: the lowest of many noisy losses is a lucky one.

use super::chance::{Place, losses_tell};
use super::{fill, unfitted};
use crate::laws::file::{LawKind, Laws};
use crate::laws::input::{
    FitError, FitOptions, IsoFlopPoint, Parameters, compare, is_same_budget, metric_of,
};
use crate::laws::lines::{Columns, LawSet, PowerLaw, law_set};
use crate::laws::maths::stats::{below, distinct, extent, geometric_mean, interval95};
use crate::laws::say::warnings;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rayon::prelude::*;

/// The laws through the frontier, with intervals from drawing curves anew.
///
/// # Errors
/// [`FitError`]: wrong values, losses that tell no law, or a frontier of fewer than three sizes or along the smallest or
/// largest ones.
pub fn approach1(points: &[IsoFlopPoint], options: &FitOptions) -> Result<Laws, FitError> {
    if points.is_empty() {
        return Err(FitError::NoPoints);
    }
    metric_of(points)?;
    points.iter().try_for_each(|p| p.check(options.parameters))?;
    losses_tell(&Place::of_runs(points))?;
    let candidates = Candidates::new(points, true);
    let front = candidates.lowest(&vec![true; candidates.n_curves]);
    let reference = geometric_mean(front.iter().map(|p| p.flops));
    let sizes = distinct(front.iter().map(|p| p.params_nonvocab)).len();
    let fitted = through(&front, reference, options).filter(|_| sizes >= LEAST_SIZES);
    let fitted = fitted.ok_or_else(|| {
        FitError::NotIdentified(format!(
            "the frontier of the lowest loss holds {sizes} size(s), but its laws need \
             {LEAST_SIZES}; give runs of more sizes and budgets"
        ))
    })?;
    if let Some((n, end, other)) = candidates.edge(&front) {
        return Err(FitError::NotIdentified(format!(
            "the frontier of the lowest loss has the {end} size at all of its {n} budgets, so the sizes tried set \
             its law; give runs of {other} sizes"
        )));
    }
    let replicates = replicates(&candidates, reference, options);
    Ok(laws(points, &front, fitted, &replicates, options))
}

/// Refits to curves drawn with replacement; a curve drawn twice counts once.
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
    laws.judgement.rows.extend(warnings::of_two_budgets(&distinct_budgets(points)));
    laws.answered()
}

fn interval(replicates: &[LawSet], of: impl Fn(&LawSet) -> Option<f64>) -> Option<[f64; 2]> {
    interval95(replicates.iter().filter_map(of))
}

/// What the runs spent, ascending, each once.
fn distinct_budgets(points: &[IsoFlopPoint]) -> Vec<f64> {
    let mut all = distinct(points.iter().map(|p| p.flops));
    all.dedup_by(|b, a| is_same_budget(*a, *b));
    all
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

// The frontier of approach 1: the running minimum of the loss over C, of runs and of the curves between them.

/// Fewest sizes on a frontier: with one or two, the grid alone would set the law.
const LEAST_SIZES: usize = 3;

/// Values of C at which training curves are read.
const GRID: usize = 256;

/// The configuration that holds the lowest loss seen up to some C.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontierPoint {
    pub flops: f64,
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    pub n_vocab: f64,
    pub tokens: f64,
    pub loss: f64,
}

/// The running minimum of the loss over C, ascending in C.
pub fn frontier(points: &[IsoFlopPoint], interpolate: bool) -> Vec<FrontierPoint> {
    let candidates = Candidates::new(points, interpolate);
    candidates.lowest(&vec![true; candidates.n_curves])
}

/// Every point that may be on a frontier, ascending in C, and by loss where C is the same but for rounding, with
/// the curve it belongs to: sorted once, so that a frontier of some of the curves is one pass.
struct Candidates {
    points: Vec<(usize, FrontierPoint)>,
    n_curves: usize,
}

impl Candidates {
    /// Every run, and between the runs of a training curve its loss interpolated in ln C.
    fn new(points: &[IsoFlopPoint], interpolate: bool) -> Self {
        let curves = curves(points);
        let range = extent(points.iter().map(|p| p.flops.ln()));
        let mut all = Vec::new();
        for (index, curve) in curves.iter().enumerate() {
            all.extend(curve.iter().map(|p| (index, measured(p))));
            if interpolate && curve.len() > 1 {
                let step = (range[1] - range[0]) / GRID as f64;
                let values = (1..GRID).map(|i| range[0] + step * i as f64);
                all.extend(values.filter_map(|ln_flops| Some((index, at(curve, ln_flops)?))));
            }
        }
        all.sort_by(|(_, a), (_, b)| a.flops.total_cmp(&b.flops));
        let of_one_budget = all.chunk_by_mut(|(_, a), (_, b)| is_same_budget(a.flops, b.flops));
        of_one_budget.for_each(|runs| runs.sort_by(|a, b| a.1.loss.total_cmp(&b.1.loss)));
        Self { points: all, n_curves: curves.len() }
    }

    /// The end of the sizes, and the sizes beyond it, where a frontier has nothing but that end: at three values of C or
    /// more, counting those at which three sizes or more were measured.
    fn edge(&self, front: &[FrontierPoint]) -> Option<(usize, &'static str, &'static str)> {
        let size = |p: &FrontierPoint| p.params_nonvocab;
        let all = self.points.chunk_by(|(_, a), (_, b)| is_same_budget(a.flops, b.flops));
        let ends = all.filter_map(|there| {
            let own = there.iter().find_map(|(_, p)| front.contains(p).then_some(size(p)))?;
            let sizes = distinct(there.iter().map(|(_, p)| size(p)));
            (sizes.len() >= LEAST_SIZES).then(|| [own == sizes[0], Some(&own) == sizes.last()])
        });
        let ends: Vec<[bool; 2]> = ends.collect();
        let words = [("smallest", "smaller"), ("largest", "larger")];
        let enough = ends.len() >= LEAST_SIZES;
        let at = (0..2).find(|end| enough && ends.iter().all(|there| there[*end]))?;
        Some((ends.len(), words[at].0, words[at].1))
    }

    /// The points of the chosen curves with a lower loss than every point at less C.
    fn lowest(&self, chosen: &[bool]) -> Vec<FrontierPoint> {
        let mut least = f64::INFINITY;
        let mut lowest = Vec::new();
        for (curve, point) in &self.points {
            if chosen[*curve] && point.loss < least {
                least = point.loss;
                lowest.push(*point);
            }
        }
        lowest
    }
}

/// Runs of one configuration and seed, each ascending in C.
fn curves(points: &[IsoFlopPoint]) -> Vec<Vec<&IsoFlopPoint>> {
    let key = |p: &IsoFlopPoint| [p.params_nonvocab, p.params_vocab, p.n_vocab, p.seed as f64];
    let mut rows: Vec<&IsoFlopPoint> = points.iter().collect();
    rows.sort_by(|a, b| compare(&key(a), &key(b)).then(a.flops.total_cmp(&b.flops)));
    rows.chunk_by(|a, b| key(a) == key(b)).map(<[_]>::to_vec).collect()
}

fn measured(p: &IsoFlopPoint) -> FrontierPoint {
    FrontierPoint {
        flops: p.flops,
        params_nonvocab: p.params_nonvocab,
        params_vocab: p.params_vocab,
        n_vocab: p.n_vocab,
        tokens: p.tokens,
        loss: p.loss,
    }
}

/// A curve's point at e^`ln_flops`, linear in ln C between two runs; none outside them.
fn at(curve: &[&IsoFlopPoint], ln_flops: f64) -> Option<FrontierPoint> {
    let right = curve.partition_point(|p| p.flops.ln() < ln_flops);
    let (a, b) = (curve.get(right.checked_sub(1)?)?, curve.get(right)?);
    let share = (ln_flops - a.flops.ln()) / (b.flops.ln() - a.flops.ln());
    let mix = |a: f64, b: f64| a + share * (b - a);
    Some(FrontierPoint {
        flops: ln_flops.exp(),
        tokens: mix(a.tokens.ln(), b.tokens.ln()).exp(),
        loss: mix(a.loss, b.loss),
        ..measured(a)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::fit::frontier;
    use crate::laws::simulated::point;

    /// Training curves of five sizes, whose envelope is N = C^½ and L = 2 + C^−0.1.
    fn curves() -> Vec<IsoFlopPoint> {
        let mut runs = Vec::new();
        for size in 0..12 {
            let n = 1e6 * 2f64.powi(size);
            for step in 0..40 {
                let c = 1e12 * 1.5f64.powi(step);
                let off = (n / c.sqrt()).ln();
                let loss = 2.0 + c.powf(-0.1) * (1.0 + 0.2 * off * off);
                runs.push(IsoFlopPoint {
                    budget_flops: c,
                    flops: c,
                    params_vocab: 0.0,
                    n_vocab: 0.0,
                    tokens: c / 6.0 / n,
                    ..point(n, 1.0, loss, 0)
                });
            }
        }
        runs
    }

    fn options() -> FitOptions {
        FitOptions {
            name: "curves".into(),
            flops_rule: "6nd".into(),
            parameters: Parameters::Total,
            bootstrap: 60,
            ..FitOptions::default()
        }
    }

    #[test]
    fn the_envelope_of_training_curves_is_recovered() {
        let inside = |p: &IsoFlopPoint| (4e12..4e18).contains(&p.flops);
        let runs: Vec<IsoFlopPoint> = curves().into_iter().filter(inside).collect();
        let laws = approach1(&runs, &options()).unwrap();
        let size = laws.power_laws.params.unwrap();
        assert!((size.exponent - 0.5).abs() < 0.02, "{size:?}");
        let [low, high] = size.exponent_ci95.unwrap();
        assert!(low <= size.exponent && size.exponent <= high, "{low} {high}");
        assert!((laws.power_laws.tokens.unwrap().exponent - 0.5).abs() < 0.02);
    }

    #[test]
    fn budgets_that_differ_by_rounding_alone_give_one_frontier() {
        let budgets = [1e18, 1e19, 1e20, 1e21];
        let runs = |jitter: f64| -> Vec<IsoFlopPoint> {
            let of = |(i, run): (usize, IsoFlopPoint)| {
                let c = budgets[i % 4] * (1.0 + jitter * ((i * 7 % 5) as f64 - 2.0));
                let off = (run.params_nonvocab / c.sqrt()).ln();
                let loss = 2.0 + c.powf(-0.1) * (1.0 + 0.02 * off * off);
                IsoFlopPoint { budget_flops: c, flops: c, loss, ..run }
            };
            curves().into_iter().enumerate().map(of).collect()
        };
        let sizes = |runs: &[IsoFlopPoint]| {
            let front = frontier(runs, true);
            front.iter().map(|point| point.params_nonvocab).collect::<Vec<f64>>()
        };
        assert_eq!(sizes(&runs(1e-14)), sizes(&runs(0.0)));
    }

    #[test]
    fn an_exponent_that_no_optimum_has_is_a_doubt() {
        let swapped = |run: IsoFlopPoint| IsoFlopPoint {
            params_nonvocab: run.flops.powf(1.4) / run.params_nonvocab.sqrt(),
            ..run
        };
        let runs: Vec<IsoFlopPoint> = curves().into_iter().map(swapped).collect();
        let answer = approach1(&runs, &options()).unwrap().answer();
        let value = answer.exponents.params.unwrap().value.unwrap();
        assert!(value > 1.0, "{value}");
        assert!(
            answer.doubts.iter().any(|doubt| doubt.kind == "implausible"),
            "{:?}",
            answer.doubts
        );
    }

    #[test]
    fn two_budgets_alone_are_told() {
        let two = [12, 30].map(|step| 1e12 * 1.5f64.powi(step));
        let runs = curves().into_iter().filter(|p| two.contains(&p.flops));
        let runs: Vec<IsoFlopPoint> = runs.collect();
        let laws = approach1(&runs, &options()).unwrap();
        let doubts = laws.answer().doubts;
        assert!(
            doubts.iter().any(|doubt| doubt.what.contains("two budgets fit any")),
            "{doubts:?}"
        );
    }

    #[test]
    fn the_frontier_falls_and_holds_the_lowest_loss_up_to_each_compute() {
        let runs = curves();
        for interpolate in [false, true] {
            let front = frontier(&runs, interpolate);
            assert!(front.is_sorted_by(|a, b| a.flops <= b.flops && a.loss > b.loss));
            for run in &runs {
                let seen = front.iter().filter(|p| p.flops <= run.flops);
                let least = seen.map(|p| p.loss).fold(f64::INFINITY, f64::min);
                assert!(least <= run.loss);
            }
        }
        assert!(frontier(&runs, true).len() > frontier(&runs, false).len());
    }

    #[test]
    fn a_frontier_along_the_smallest_or_largest_sizes_is_refused() {
        let beyond = |is_kept: fn(f64, f64) -> bool| {
            let all = curves().into_iter().filter(|p| (4e15..4e17).contains(&p.flops));
            let kept = all.filter(|p| is_kept(p.params_nonvocab, p.flops.sqrt()));
            approach1(&kept.collect::<Vec<_>>(), &options())
        };
        for (is_kept, end, other) in [
            ((|n, best| n > 1.5 * best) as fn(f64, f64) -> bool, "smallest", "smaller"),
            (|n, best| n < 0.6 * best, "largest", "larger"),
        ] {
            let error = beyond(is_kept).unwrap_err();
            assert!(error.is_unidentifiable());
            let told = error.to_string();
            assert!(told.contains(end) && told.contains(other), "{told}");
        }
        beyond(|_, _| true).unwrap();
    }

    #[test]
    fn a_frontier_of_one_size_is_refused_with_the_reason() {
        let error = approach1(&curves()[..20], &options()).err().unwrap();
        assert!(error.is_unidentifiable());
        assert!(error.to_string().contains("1 size(s)"), "{error}");
        assert_eq!(approach1(&[], &options()).unwrap_err(), FitError::NoPoints);
    }
}
