//! Which law to believe: the one that predicts the sweep's own larger budgets from its smaller ones.

use super::joint::{JointLaw, above, fit_joint, repeat};
use super::law_set::{Columns, LawSet, geometric_mean, law_set};
use super::minima::Grid;
use super::stats::NORMAL_97_5;
use super::{
    Candidate, FitOptions, FloorLaw, MeasuredTo, Minimum, Miss, Parameters, Recommended, RunNoise,
    Score, floor_law,
};
use crate::sweep::MinimumMethod;

/// Fewest budgets that a law is fitted to before it is tested.
const FEWEST: usize = 3;

/// All budgets of a sweep with their measured minima, ascending.
pub(super) struct Rows<'a> {
    pub grids: &'a [Grid],
    /// The minimum of each grid by the laws' method; none where it may not be used.
    pub minima: &'a [Option<Minimum>],
    pub noise: Option<RunNoise>,
    pub options: &'a FitOptions,
}

/// Power laws through minima, with both laws of their losses.
struct Lines {
    set: LawSet,
    floor: Option<FloorLaw>,
    reference: f64,
}

/// A law through the first budgets of a sweep.
enum Fitted {
    Lines(Box<Lines>),
    Joint(Box<JointLaw>),
}

impl Rows<'_> {
    /// Every candidate's score, the best first; empty where there are too few budgets.
    pub fn scores(&self) -> Vec<Score> {
        // The joint law with repetition holds the other, R without end: where runs repeat their data it is
        // the one, and the other would learn of repetition by missing it.
        let unfit = if repeat(self.grids) { Candidate::Joint } else { Candidate::JointRepeats };
        let candidates = Candidate::ALL.into_iter().filter(|law| *law != unfit);
        let mut scores: Vec<Score> = candidates.filter_map(|law| self.score(law)).collect();
        let most = scores.iter().map(|score| score.misses.len()).max().unwrap_or(0);
        // One that could not be tested everywhere is not compared.
        scores.retain(|score| score.misses.len() == most && score.rms.is_finite());
        scores.sort_by(|a, b| a.rms.total_cmp(&b.rms));
        scores
    }

    fn score(&self, law: Candidate) -> Option<Score> {
        let starts = FEWEST..self.grids.len();
        let misses: Vec<Miss> = starts.flat_map(|n| self.misses(law, n)).collect();
        let squares: f64 = misses.iter().map(|miss| miss.loss.powi(2)).sum();
        let rms = (squares / misses.len() as f64).sqrt();
        (!misses.is_empty()).then_some(Score { law, rms, misses })
    }

    /// What a law through the first `n` budgets says of the others.
    fn misses(&self, law: Candidate, n: usize) -> Vec<Miss> {
        let Some(fitted) = self.fit(law, n) else { return Vec::new() };
        let largest = self.grids[n - 1].budget_flops;
        let measured = self.grids[n..].iter().zip(&self.minima[n..]);
        let measured = measured.filter_map(|(grid, minimum)| Some((grid, minimum.as_ref()?)));
        measured.filter_map(|measured| self.miss(law, &fitted, measured, n, largest)).collect()
    }

    fn fit(&self, law: Candidate, n: usize) -> Option<Fitted> {
        let used: Vec<Minimum> = self.minima[..n].iter().flatten().cloned().collect();
        if used.len() < FEWEST {
            return None;
        }
        if law.is_joint() {
            let repeats = law == Candidate::JointRepeats;
            let joint = fit_joint(&self.grids[..n], self.noise, repeats)?;
            return Some(Fitted::Joint(Box::new(joint)));
        }
        let columns = Columns::new(&used, self.grids, self.options);
        let reference = geometric_mean(&columns.compute);
        let set = law_set(&columns, reference, self.options)?;
        let floor = floor_law(&columns.compute, &columns.loss, reference);
        let lines = Lines { set, floor, reference };
        let is_whole = law == Candidate::Log || lines.floor.is_some();
        is_whole.then(|| Fitted::Lines(Box::new(lines)))
    }

    fn miss(
        &self,
        law: Candidate,
        fitted: &Fitted,
        (grid, measured): (&Grid, &Minimum),
        n_fitted: usize,
        largest: f64,
    ) -> Option<Miss> {
        let at = measured.budget_flops;
        let mut measured_to = measured_to(measured);
        let [loss, lowest, size, vocab, tokens] = match fitted {
            Fitted::Joint(joint) => {
                let best = joint.optimum(at)?;
                let [loss, sd] = above(joint, grid, self.noise);
                measured_to.loss = sd;
                [loss, best.loss, best.params_nonvocab, best.params_vocab, best.tokens]
            }
            Fitted::Lines(lines) => {
                let Lines { set, floor, reference } = &**lines;
                let loss = match law {
                    Candidate::Log => set.loss.loss_at(at),
                    _ => floor.as_ref()?.loss_at(at, *reference),
                };
                let vocab = set.params_vocab.as_ref().map_or(0.0, |law| law.value_at(at));
                let miss = loss - measured.loss_normalised;
                [miss, loss, set.params_nonvocab.value_at(at), vocab, set.tokens.value_at(at)]
            }
        };
        let split = self.options.parameters == Parameters::Split;
        Some(Miss {
            n_fitted,
            budget_flops: measured.budget_flops,
            factor: measured.budget_flops / largest,
            loss,
            of_minimum: lowest - measured.loss_normalised,
            ln_size: (size / measured.params_nonvocab).ln(),
            ln_vocab: if split { (vocab / measured.params_vocab).ln() } else { 0.0 },
            ln_tokens: (tokens / measured.tokens).ln(),
            measured_to,
        })
    }
}

/// How precisely a minimum was measured, read off its intervals.
fn measured_to(minimum: &Minimum) -> MeasuredTo {
    let ci = minimum.ci95.unwrap_or_default();
    let sd = |interval: Option<[f64; 2]>, of: fn(f64) -> f64| {
        interval.map_or(0.0, |[low, high]| (of(high) - of(low)) / (2.0 * NORMAL_97_5))
    };
    let ln_size = sd(ci.params_nonvocab, f64::ln);
    let ln_vocab = sd(ci.params_vocab, f64::ln);
    // D = C / 6(N_nv + N_v), its logarithm to first order.
    let share = minimum.params_vocab / (minimum.params_nonvocab + minimum.params_vocab);
    let ln_tokens = ((1.0 - share) * ln_size).hypot(share * ln_vocab);
    MeasuredTo { loss: sd(ci.loss_normalised, |x| x), ln_size, ln_vocab, ln_tokens }
}

/// The best of some scores, or the log law where nothing could be tested.
pub(super) fn recommended(
    scores: Vec<Score>,
    minima_method: MinimumMethod,
    budgets: usize,
) -> Recommended {
    let law = scores.first().map_or(Candidate::Log, |best| best.law);
    let why = match (scores.first(), scores.last()) {
        (Some(best), Some(worst)) if scores.len() > 1 => format!(
            "fitted to smaller budgets, it missed the losses of larger ones by {:.4} nats (root mean \
             square of {}), {} by {:.4}",
            best.rms,
            best.misses.len(),
            worst.law.about(),
            worst.rms
        ),
        (Some(_), _) => "no other law could be tested".to_string(),
        (None, _) => format!("{budgets} budgets are too few to test any law, so ScaMo's stands"),
    };
    Recommended { law, minima_method, why, scores }
}
