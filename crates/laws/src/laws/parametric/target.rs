//! The objective over points, as columns under a form, and its descent.

use super::form::{Coefficients, Constant, Form, Slots, Space, Vector};
use super::newton::{Minimised, Problem, minimise};
use super::objective::{Columns, Curvature, Objective};
use crate::laws::input::{FitError, IsoFlopPoint, metric_of};
use crate::laws::maths::stats::dot;

/// Spread of a logarithm below which a quantity counts as constant.
const CONSTANT: f64 = 1e-6;
/// Least number of values of a quantity: its term has two unknowns besides the floor.
const LEVELS: usize = 3;
/// Correlation of two logarithms above which their terms cannot be separated.
const COLLINEAR: f64 = 0.9999;

/// The rows of a fit: columns around their means, and weights.
#[derive(Clone, Debug)]
pub(super) struct Data {
    pub columns: Columns,
    pub weights: Vec<f64>,
    /// Means of ln x, in the form's order.
    pub means: Vec<f64>,
    /// The losses, for the starts.
    pub losses: Vec<f64>,
    /// How E is parametrised.
    pub constant: Constant,
}

impl Data {
    /// # Errors
    /// [`FitError::BadValue`] and [`FitError::BadLoss`] for a value that cannot be fitted;
    /// [`FitError::Metrics`]; [`FitError::NotIdentified`] for too few rows, or quantities that do not
    /// vary or vary together.
    pub fn new(points: &[IsoFlopPoint], form: Form, space: Space) -> Result<Self, FitError> {
        metric_of(points)?;
        points.iter().try_for_each(|p| check(p, form, space))?;
        if points.len() <= form.n_params() {
            return Err(FitError::NotIdentified(format!(
                "{} rows cannot tell the {} coefficients of {}; give at least {}",
                points.len(),
                form.n_params(),
                form.names().join(", "),
                form.n_params() + 1
            )));
        }
        let quantity = |k: usize| points.iter().map(|p| form.quantities_of(p)[k].ln()).collect();
        let (x, means): (Vec<Vec<f64>>, Vec<f64>) =
            (0..form.n_terms()).map(quantity).map(centred).unzip();
        identified(&x, form)?;
        let losses: Vec<f64> = points.iter().map(|p| p.loss).collect();
        let columns = Columns::new(x, losses.iter().map(|loss| space.of(*loss)).collect());
        let weights = columns.weights(points.iter().map(|p| p.weight).collect());
        let constant = form.constant(&losses);
        Ok(Self { columns, weights, means, losses, constant })
    }

    /// Some rows, in the order given and as often as given, around the same means.
    pub fn rows(&self, rows: &[usize]) -> Self {
        let pick = |column: &Vec<f64>| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
        let columns =
            Columns::new(self.columns.x.iter().map(pick).collect(), pick(&self.columns.y));
        let weights = columns.weights(pick(&self.weights));
        let (means, losses) = (self.means.clone(), pick(&self.losses));
        Self { columns, weights, means, losses, constant: self.constant }
    }

    /// Each row as often as `times` has it, by its weight.
    pub fn repeated(&self, times: &[usize]) -> Self {
        let rows: Vec<usize> = (0..times.len()).filter(|row| times[*row] > 0).collect();
        let mut data = self.rows(&rows);
        data.weights.iter_mut().zip(rows).for_each(|(weight, row)| *weight *= times[row] as f64);
        data
    }
}

fn check(p: &IsoFlopPoint, form: Form, space: Space) -> Result<(), FitError> {
    let bad = |field, value, expected| {
        Err(FitError::BadValue { run_id: p.run_id.clone(), field, value, expected })
    };
    for (name, value) in form.quantities().iter().zip(form.quantities_of(p)) {
        if !(value.is_finite() && value > 0.0) {
            return bad(name, value, "finite and above 0");
        }
    }
    if !(p.weight.is_finite() && p.weight >= 0.0) {
        return bad("weight", p.weight, "finite and not below 0");
    }
    match space {
        Space::Log if !(p.loss.is_finite() && p.loss > 0.0) => Err(FitError::bad_loss(
            p,
            "finite and above 0 where its logarithm is fitted (--space raw fits the loss itself)",
        )),
        Space::Raw if !p.loss.is_finite() => Err(FitError::bad_loss(p, "finite")),
        _ => Ok(()),
    }
}

fn centred(mut column: Vec<f64>) -> (Vec<f64>, f64) {
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    column.iter_mut().for_each(|x| *x -= mean);
    (column, mean)
}

/// The number of distinct values of a column; logarithms closer than [`CONSTANT`] count as one.
fn levels(column: &[f64]) -> usize {
    let mut sorted = column.to_vec();
    sorted.sort_by(f64::total_cmp);
    1 + sorted.windows(2).filter(|pair| pair[1] - pair[0] > CONSTANT).count()
}

fn identified(x: &[Vec<f64>], form: Form) -> Result<(), FitError> {
    let names = form.quantities();
    let unknown = |reason| Err(FitError::NotIdentified(reason));
    for (i, column) in x.iter().enumerate() {
        if (dot(column, column) / column.len() as f64).sqrt() < CONSTANT {
            return unknown(format!(
                "{} is the same in every row, so its term is unknown",
                names[i]
            ));
        }
        let levels = levels(column);
        if levels < LEVELS {
            return unknown(format!(
                "{} has {levels} different values, but a coefficient, an exponent and the floor need \
                 {LEVELS}; add runs at another",
                names[i]
            ));
        }
        for (j, other) in x[..i].iter().enumerate() {
            let cosine = dot(column, other) / (dot(column, column) * dot(other, other)).sqrt();
            if cosine.abs() > COLLINEAR {
                return unknown(format!(
                    "{} and {} rise and fall together in every row (correlation of their \
                     logarithms {cosine:.5}), so their terms cannot be told apart; add runs that \
                     vary one alone",
                    names[j], names[i]
                ));
            }
        }
    }
    Ok(())
}

/// The objective.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target<'a> {
    pub data: &'a Data,
    pub form: Form,
    pub space: Space,
    pub delta: f64,
    /// Whether the first exponent equals the last.
    pub tied: bool,
    /// Least and largest exponent.
    pub bounds: [f64; 2],
}

/// The end of a descent.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// All parameters, centred.
    pub theta: Vector,
    pub minimised: Minimised,
}

impl<'a> Target<'a> {
    /// The coefficients in the units of the table's columns.
    pub fn coefficients(&self, theta: &Vector) -> Coefficients {
        Coefficients::from_centred(self.form, self.data.constant, theta, &self.data.means)
    }

    pub fn problem(
        &self,
        (delta, curvature): (f64, Curvature),
        slots: Slots,
        base: Vector,
        weights: &'a [f64],
    ) -> Problem<'a> {
        let (columns, constant) = (&self.data.columns, self.data.constant);
        let objective =
            Objective { columns, weights, space: self.space, constant, delta, curvature };
        Problem::new(objective, slots, base)
    }

    /// Downhill from anywhere, first stage: least squares by Gauss and Newton.
    pub fn approach(&self, start: &Vector) -> Option<Vector> {
        self.stage((f64::INFINITY, Curvature::GaussNewton), start, 1e-12)
    }

    /// The later stages: Huber's function at ten times δ, then at δ. Each stage hands the next a start within its
    /// reach.
    pub fn descend(&self, near: &Vector) -> Option<End> {
        let at = self.stage((10.0 * self.delta, Curvature::Exact), near, 1e-6)?;
        self.settle(&at, &self.data.weights, 1e-12)
    }

    fn stage(&self, how: (f64, Curvature), start: &Vector, tolerance: f64) -> Option<Vector> {
        let slots = self.form.slots(self.tied);
        let problem = self.problem(how, slots, *start, &self.data.weights);
        Some(problem.full(&minimise(problem, problem.free(start), tolerance)?.free))
    }

    /// Downhill from near an optimum. An exponent that leaves its bounds is set to the nearer one
    /// and stays there while the others go on.
    pub fn settle(&self, start: &Vector, weights: &[f64], tolerance: f64) -> Option<End> {
        let (k, [least, most]) = (self.form.n_terms(), self.bounds);
        let mut slots = self.form.slots(self.tied);
        let mut theta = *start;
        loop {
            let target = Target { data: self.data, ..*self };
            let how = (self.delta, Curvature::Exact);
            let problem = target.problem(how, slots, theta, weights).within(self.bounds);
            let minimised = minimise(problem, problem.free(&theta), tolerance)?;
            theta = problem.full(&minimised.free);
            let outside = |p: &usize| slots[*p].is_some() && !(least..=most).contains(&theta[*p]);
            let Some(stray) = (k + 1..=2 * k).find(outside) else {
                return Some(End { theta, minimised });
            };
            let slot = slots[stray];
            for p in (k + 1..=2 * k).filter(|p| slots[*p] == slot) {
                theta[p] = theta[p].clamp(least, most);
            }
            slots = slots.map(|s| if s == slot { None } else { s });
        }
    }
}
