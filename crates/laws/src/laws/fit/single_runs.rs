//! The frontier of approach 1: the running minimum of the loss over C, of runs and of the curves between them.

use crate::laws::input::{IsoFlopPoint, compare, is_same_budget};
use crate::laws::maths::stats::{distinct, extent};

/// Fewest sizes on a frontier: with one or two, the grid alone would set the law.
pub(super) const LEAST_SIZES: usize = 3;

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
pub(super) struct Candidates {
    points: Vec<(usize, FrontierPoint)>,
    pub n_curves: usize,
}

impl Candidates {
    /// Every run, and between the runs of a training curve its loss interpolated in ln C.
    pub fn new(points: &[IsoFlopPoint], interpolate: bool) -> Self {
        let curves = curves(points);
        let range = extent(points.iter().map(|p| p.flops.ln()));
        let mut all = Vec::new();
        for (index, curve) in curves.iter().enumerate() {
            all.extend(curve.iter().map(|p| (index, measured(p))));
            if interpolate && curve.len() > 1 {
                all.extend(between(curve, range).map(|p| (index, p)));
            }
        }
        all.sort_by(|(_, a), (_, b)| a.flops.total_cmp(&b.flops));
        let of_one_budget = all.chunk_by_mut(|(_, a), (_, b)| is_same_budget(a.flops, b.flops));
        of_one_budget.for_each(|runs| runs.sort_by(|a, b| a.1.loss.total_cmp(&b.1.loss)));
        Self { points: all, n_curves: curves.len() }
    }

    /// The end of the sizes, and the sizes beyond it, where a frontier has nothing but that end: at three values of C or
    /// more, counting those at which three sizes or more were measured.
    pub fn edge(&self, front: &[FrontierPoint]) -> Option<(usize, &'static str, &'static str)> {
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
    pub fn lowest(&self, chosen: &[bool]) -> Vec<FrontierPoint> {
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

/// A curve at the values of C that lie strictly between two of its runs.
fn between(curve: &[&IsoFlopPoint], [low, high]: [f64; 2]) -> impl Iterator<Item = FrontierPoint> {
    let step = (high - low) / GRID as f64;
    (1..GRID).filter_map(move |i| at(curve, low + step * i as f64))
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
