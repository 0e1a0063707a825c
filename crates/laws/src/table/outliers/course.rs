//! Runs off the smooth course that losses take over sizes and budgets.
//!
//! Around each run a polynomial in ln N goes through the nearest sizes of its budget and, moved along the
//! optimum, of the neighbouring budgets. Each budget has its own level; slope and curvature change evenly
//! with ln C; one cubic term serves all where there are sizes for it. Where r = M·y are the residuals of
//! least squares, leaving a run out lowers their sum of squares by its fall r²/M, which judges ends and
//! inner sizes alike, and z = |r|/√M scatters as one run does.

use crate::laws::IsoFlopPoint;

/// Where a size stands among those of its budget.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    Inner,
    Smallest,
    Largest,
}

/// A run against the course around it.
#[derive(Clone)]
pub(super) struct Judged {
    pub run: usize,
    pub place: Place,
    pub z: f64,
    /// The loss less what the others predict there.
    pub miss: f64,
    /// The share of a degree of freedom that the run has of itself, M.
    pub share: f64,
    /// How far the sum of squares falls without each run of the course.
    pub falls: Vec<(usize, f64)>,
}

impl Judged {
    /// The run, and others whose fall is no lower than the largest by `apart`.
    pub fn rivals(&self, apart: f64) -> Vec<usize> {
        let largest = self.falls.iter().fold(0.0f64, |most, (_, fall)| most.max(*fall));
        let near =
            self.falls.iter().filter(|(run, fall)| *run == self.run || *fall > largest - apart);
        near.map(|(run, _)| *run).collect()
    }
}

/// A run that its own course cannot miss by more than this share of its error is not judged.
const LEAST_SHARE: f64 = 0.02;

/// Each run against the course around it; none where it has no freedom.
pub(super) fn judge(points: &[IsoFlopPoint], runs: &[usize]) -> Vec<Judged> {
    let budgets = by(points, runs, |point| point.budget_flops);
    let curve = |runs: &Vec<usize>| Curve {
        ln_budget: points[runs[0]].budget_flops.ln(),
        sizes: by(points, runs, params),
    };
    let curves: Vec<Curve> = budgets.iter().map(curve).collect();
    let of_size = |own: usize, size: usize| {
        let runs = &curves[own].sizes[size];
        let place = match size {
            _ if size + 1 == curves[own].sizes.len() => Place::Largest,
            0 => Place::Smallest,
            _ => Place::Inner,
        };
        let course = Course::around(points, &curves, own, params(&points[runs[0]]).ln());
        runs.iter().filter_map(|run| course.judged(*run, place)).collect::<Vec<_>>()
    };
    let sizes =
        (0..curves.len()).flat_map(|own| (0..curves[own].sizes.len()).map(move |i| (own, i)));
    sizes.flat_map(|(own, size)| of_size(own, size)).collect()
}

/// The runs of a budget by size, ascending.
struct Curve {
    ln_budget: f64,
    sizes: Vec<Vec<usize>>,
}

/// Sizes on each side of a place that a course goes through, and as many where it has no neighbouring budget.
const REACH: [usize; 2] = [2, 3];
/// Sizes that a neighbouring budget needs.
const SIZES: usize = 3;
/// Neighbouring budgets: at least, where there are so many, and at most.
const NEIGHBOURS: [usize; 2] = [2, 4];
/// Degrees of freedom that no further neighbour is needed for.
const ENOUGH: usize = 6;
/// How the place of an optimum moves with ln C, in ln N.
const ALONG: f64 = 0.5;

/// The least-squares polynomial around a place.
struct Course {
    runs: Vec<usize>,
    residuals: Vec<f64>,
    /// The diagonal of M.
    shares: Vec<f64>,
}

impl Course {
    fn around(points: &[IsoFlopPoint], curves: &[Curve], own: usize, x: f64) -> Self {
        let far = |curve: &&Curve| (curve.ln_budget - curves[own].ln_budget).abs();
        let others = curves.iter().enumerate().filter(|(i, c)| *i != own && c.sizes.len() >= SIZES);
        let mut others: Vec<&Curve> = others.map(|(_, curve)| curve).collect();
        others.sort_by(|a, b| far(a).total_cmp(&far(b)));
        let all: Vec<&Curve> = [&curves[own]].into_iter().chain(others).collect();
        let mut count = all.len().min(1 + NEIGHBOURS[0]);
        loop {
            let columns = Columns::new(points, &all[..count], x);
            let enough = columns.runs.len() >= columns.of.len() + ENOUGH;
            if enough || count == all.len().min(1 + NEIGHBOURS[1]) {
                return columns.course(points);
            }
            count += 1;
        }
    }

    fn judged(&self, run: usize, place: Place) -> Option<Judged> {
        let fall = |i: usize| self.residuals[i].powi(2) / self.shares[i];
        let free = |i: &usize| self.shares[*i] > LEAST_SHARE;
        let at = self.runs.iter().position(|other| *other == run).filter(free)?;
        let falls = (0..self.runs.len()).filter(free).map(|i| (self.runs[i], fall(i))).collect();
        let (miss, share) = (self.residuals[at] / self.shares[at], self.shares[at]);
        Some(Judged { run, place, z: fall(at).sqrt(), miss, share, falls })
    }
}

/// The runs of a course, and the columns of its polynomial.
struct Columns {
    runs: Vec<usize>,
    of: Vec<Vec<f64>>,
}

impl Columns {
    /// Around `x` on the first of the curves.
    fn new(points: &[IsoFlopPoint], curves: &[&Curve], x: f64) -> Self {
        let reach = REACH[usize::from(curves.len() == 1)];
        let step = |curve: &Curve| curve.ln_budget - curves[0].ln_budget;
        let windows = curves.iter().map(|c| c.window(points, x + ALONG * step(c), reach));
        let windows: Vec<&[Vec<usize>]> = windows.collect();
        let sizes: usize = windows.iter().map(|window| window.len()).sum();
        let of_budget = |(i, window): (usize, &&[Vec<usize>])| {
            window.concat().into_iter().map(move |run| (i, run)).collect::<Vec<_>>()
        };
        let rows: Vec<(usize, usize)> = windows.iter().enumerate().flat_map(of_budget).collect();
        let column = |of: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            rows.iter().map(|(i, run)| of(*i, params(&points[*run]).ln() - x)).collect()
        };
        let levels = (0..curves.len()).map(|own| column(&|i, _| f64::from(u8::from(i == own))));
        let mut of: Vec<Vec<f64>> = levels.collect();
        of.extend([column(&|_, z| z), column(&|_, z| z * z)]);
        if curves.len() > 1 {
            of.extend([
                column(&|i, z| z * step(curves[i])),
                column(&|i, z| z * z * step(curves[i])),
            ]);
        }
        if sizes > 2 * of.len() {
            of.push(column(&|_, z| z.powi(3)));
        }
        Self { runs: rows.into_iter().map(|(_, run)| run).collect(), of }
    }

    /// By orthonormal columns; one that follows from those before it is left out.
    fn course(self, points: &[IsoFlopPoint]) -> Course {
        let mut residuals: Vec<f64> = self.runs.iter().map(|run| points[*run].loss).collect();
        let mut shares = vec![1.0; residuals.len()];
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for mut column in self.of {
            let before = norm(&column);
            (0..2).for_each(|_| basis.iter().for_each(|unit| clear(&mut column, unit)));
            let left = norm(&column);
            if left > DEPENDENT * before {
                column.iter_mut().for_each(|x| *x /= left);
                shares.iter_mut().zip(&column).for_each(|(share, x)| *share -= x * x);
                basis.push(column);
            }
        }
        (0..2).for_each(|_| basis.iter().for_each(|unit| clear(&mut residuals, unit)));
        Course { runs: self.runs, residuals, shares }
    }
}

impl Curve {
    /// The sizes nearest to a place by rank: `reach` on either side, and more of one side at an end.
    fn window(&self, points: &[IsoFlopPoint], x: f64, reach: usize) -> &[Vec<usize>] {
        let below = |size: &Vec<usize>| params(&points[size[0]]).ln() < x - 1e-9;
        let at = self.sizes.partition_point(below).min(self.sizes.len() - 1);
        let count = (2 * reach + 1).min(self.sizes.len());
        let first = at.saturating_sub(reach).min(self.sizes.len() - count);
        &self.sizes[first..first + count]
    }
}

/// What is left of a column, as a share, if it follows from others.
const DEPENDENT: f64 = 1e-6;

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Takes the part along a unit vector out.
fn clear(values: &mut [f64], unit: &[f64]) {
    let along: f64 = values.iter().zip(unit).map(|(x, u)| x * u).sum();
    values.iter_mut().zip(unit).for_each(|(x, u)| *x -= along * u);
}

// Points by a value of theirs.

/// Relative distance within which two values are one but for rounding.
const SAME: f64 = 1e-9;

/// N = N_nv + N_v.
pub(super) fn params(point: &IsoFlopPoint) -> f64 {
    point.params_nonvocab + point.params_vocab
}

/// Indices into `points` grouped by a value, ascending; those of each group in the order given.
pub(super) fn by(
    points: &[IsoFlopPoint],
    indices: &[usize],
    value: impl Fn(&IsoFlopPoint) -> f64,
) -> Vec<Vec<usize>> {
    let of = |index: usize| value(&points[index]);
    let mut sorted = indices.to_vec();
    sorted.sort_by(|a, b| of(*a).total_cmp(&of(*b)));
    let same = |a: &usize, b: &usize| (of(*a) - of(*b)).abs() <= SAME * of(*b).abs();
    let mut groups: Vec<Vec<usize>> = sorted.chunk_by(same).map(<[usize]>::to_vec).collect();
    groups.iter_mut().for_each(|group| group.sort_unstable());
    groups
}
