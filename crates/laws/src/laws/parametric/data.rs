//! Points as the columns of a parametric fit.

use super::form::Form;
use super::objective::{Columns, Constant, Space};
use crate::laws::input::check::{loss, metric};
use crate::laws::input::error::FitError;
use crate::laws::input::point::IsoFlopPoint;
use crate::laws::maths::stats::dot;

/// Spread of a logarithm below which a quantity counts as constant.
const CONSTANT: f64 = 1e-6;
/// Values that a quantity needs: its term has two unknowns beside the floor.
const LEVELS: usize = 3;
/// Correlation of two logarithms above which their terms cannot be told apart.
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
        metric(points)?;
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
        let y = match space {
            Space::Log => losses.iter().map(|l| l.ln()).collect(),
            Space::Raw => losses.clone(),
        };
        let columns = Columns::new(x, y);
        let weights = columns.weights(points.iter().map(|p| p.weight).collect());
        let constant = form.constant(&losses);
        Ok(Self { columns, weights, means, losses, constant })
    }
}

impl Data {
    /// Some rows, in the order given and as often as given, around the same means.
    pub fn rows(&self, rows: &[usize]) -> Self {
        let pick = |column: &Vec<f64>| rows.iter().map(|row| column[*row]).collect::<Vec<f64>>();
        let columns =
            Columns::new(self.columns.x.iter().map(pick).collect(), pick(&self.columns.y));
        let weights = columns.weights(pick(&self.weights));
        let (means, losses) = (self.means.clone(), pick(&self.losses));
        Self { columns, weights, means, losses, constant: self.constant }
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
        Space::Log if !(p.loss.is_finite() && p.loss > 0.0) => Err(loss(
            p,
            "finite and above 0 where its logarithm is fitted (--space raw fits the loss itself)",
        )),
        Space::Raw if !p.loss.is_finite() => Err(loss(p, "finite")),
        _ => Ok(()),
    }
}

fn centred(mut column: Vec<f64>) -> (Vec<f64>, f64) {
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    column.iter_mut().for_each(|x| *x -= mean);
    (column, mean)
}

/// How many different values a column has; logarithms closer than [`CONSTANT`] are one.
fn levels(column: &[f64]) -> usize {
    let mut sorted = column.to_vec();
    sorted.sort_by(f64::total_cmp);
    1 + sorted.windows(2).filter(|pair| pair[1] - pair[0] > CONSTANT).count()
}

fn identified(x: &[Vec<f64>], form: Form) -> Result<(), FitError> {
    let names = form.quantities();
    for (i, column) in x.iter().enumerate() {
        if (dot(column, column) / column.len() as f64).sqrt() < CONSTANT {
            let reason = format!("{} is the same in every row, so its term is unknown", names[i]);
            return Err(FitError::NotIdentified(reason));
        }
        let levels = levels(column);
        if levels < LEVELS {
            return Err(FitError::NotIdentified(format!(
                "{} has {levels} different values, but a coefficient, an exponent and the floor need \
                 {LEVELS}; add runs at another",
                names[i]
            )));
        }
        for (j, other) in x[..i].iter().enumerate() {
            let cosine = dot(column, other) / (dot(column, column) * dot(other, other)).sqrt();
            if cosine.abs() > COLLINEAR {
                return Err(FitError::NotIdentified(format!(
                    "{} and {} rise and fall together in every row (correlation of their \
                     logarithms {cosine:.5}), so their terms cannot be told apart; add runs that \
                     vary one alone",
                    names[j], names[i]
                )));
            }
        }
    }
    Ok(())
}
