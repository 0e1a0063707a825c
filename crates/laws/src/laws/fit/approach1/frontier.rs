//! The running minimum of the loss over C.

use crate::laws::input::cell::compare;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats::extent;

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

/// Every point that may be on a frontier, ascending in C, with the curve it belongs to: sorted
/// once, so that a frontier of some of the curves is one pass.
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
        all.sort_by(|(_, a), (_, b)| a.flops.total_cmp(&b.flops).then(a.loss.total_cmp(&b.loss)));
        Self { points: all, n_curves: curves.len() }
    }

    /// The points of the chosen curves whose loss is below that of all at less C.
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
