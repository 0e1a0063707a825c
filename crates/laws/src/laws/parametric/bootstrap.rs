//! Intervals of a parametric law by drawing rows anew (Efron 1979).
//!
//! Each replicate draws as many rows as there are and goes from the optimum downhill to its own.
//! Rows of one configuration are one cluster and are drawn together, whether a column tells their seeds or
//! not: they share what the law misses there.
//!
//! Nothing depends on the number of threads (see [`draws`](super::draws)). Tables of more than
//! `MAX_CLUSTERS` clusters draw that many and shrink the deviations by the root of the ratio (m out
//! of n; Bickel et al. 1997).

use std::collections::HashMap;

use super::draws::Draws;
use super::form::Coefficients;
use super::options::ParametricOptions;
use super::search::{End, Found, Target};
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats;
use rayon::prelude::*;

/// Clusters above which a replicate draws fewer than there are.
const MAX_CLUSTERS: usize = 20_000;
/// Relative decrease of the objective that a replicate does not go for.
const TOLERANCE: f64 = 1e-12;

/// The coefficients of every replicate.
#[derive(Clone, Debug)]
pub(super) struct Replicates {
    pub coefficients: Vec<Coefficients>,
    /// How many ended at an optimum, as all should.
    pub converged: usize,
    pub asked: usize,
}

pub(super) fn bootstrap(
    points: &[IsoFlopPoint],
    target: &Target,
    found: &Found,
    options: &ParametricOptions,
) -> Replicates {
    let clusters = clusters(points);
    let n = clusters.len();
    let draws = Draws::new(options.seed, options.bootstrap, n.min(MAX_CLUSTERS), n);
    let replicate = |i: usize| {
        let rows = draws.of(i).into_iter().flat_map(|cluster| &clusters[cluster]).copied();
        let data = target.data.rows(&rows.collect::<Vec<_>>());
        Target { data: &data, ..*target }.settle(&found.end.theta, &data.weights, TOLERANCE)
    };
    let ends: Vec<End> = (0..options.bootstrap).into_par_iter().filter_map(replicate).collect();
    let shrink = (n.min(MAX_CLUSTERS) as f64 / n as f64).sqrt();
    let centre = found.end.theta;
    let coefficients = |end: &End| {
        let near = std::array::from_fn(|p| centre[p] + shrink * (end.theta[p] - centre[p]));
        target.coefficients(&near)
    };
    Replicates {
        coefficients: ends.iter().map(coefficients).collect(),
        converged: ends.iter().filter(|end| end.minimised.converged).count(),
        asked: options.bootstrap,
    }
}

/// Rows of one configuration, in the order of their first.
fn clusters(points: &[IsoFlopPoint]) -> Vec<Vec<usize>> {
    let mut places: HashMap<[u64; 4], usize> = HashMap::new();
    let mut clusters: Vec<Vec<usize>> = Vec::new();
    for (row, p) in points.iter().enumerate() {
        let key = [p.params_nonvocab, p.params_vocab, p.n_vocab, p.tokens].map(f64::to_bits);
        let place = *places.entry(key).or_insert(clusters.len());
        if place == clusters.len() {
            clusters.push(Vec::new());
        }
        clusters[place].push(row);
    }
    clusters
}

impl Replicates {
    fn column(&self, i: usize) -> Vec<f64> {
        self.coefficients.iter().map(|c| c.values()[i]).collect()
    }

    fn each<T>(&self, of: impl Fn(&[f64]) -> Option<T>) -> Vec<T> {
        let n = self.coefficients.first().map_or(0, |c| c.values().len());
        (0..n).filter_map(|i| of(&self.column(i))).collect()
    }

    /// Standard deviations over the replicates, in the order of the form's names; empty where there
    /// are too few replicates.
    pub fn standard_errors(&self) -> Vec<f64> {
        self.each(|column| stats::interval95(column).map(|_| stats::standard_deviation(column)))
    }

    /// 95 % percentile intervals, likewise.
    pub fn intervals(&self) -> Vec<[f64; 2]> {
        self.each(|column| stats::interval95(column))
    }
}
