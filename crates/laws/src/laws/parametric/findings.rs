//! What speaks against a parametric fit.

use super::bootstrap::Replicates;
use super::form::Coefficients;
use super::search::{Found, Target};

/// Share of starts at the optimum below which a second optimum may have been missed.
const FEW_STARTS: f64 = 0.1;
/// Rows for each coefficient below which a bootstrap understates.
const ENOUGH_ROWS: usize = 6;
/// Rows for each coefficient below which a law follows single rows.
pub(in crate::laws) const LEAST_ROWS: usize = 3;
/// Share of the mean loss below which a term counts as absent.
const ABSENT: f64 = 1e-4;

/// A reason to believe a parametric fit less.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) enum Finding {
    /// The term of this quantity is absent from the best fit.
    TermAbsent(&'static str),
    /// The exponent of a quantity is held at a bound.
    AtBound(&'static str, f64),
    NoFloor,
    /// Starts that reach the optimum, of all.
    FewStarts(usize, usize),
    /// Replicates without an optimum of their own, of all.
    Unfinished(usize, usize),
    /// Rows fewer than [`LEAST_ROWS`] times the coefficients.
    TooFewRows(usize, usize),
    /// Rows for coefficients, few for a bootstrap.
    FewRows(usize, usize),
}

pub(super) fn findings(
    target: &Target,
    found: &Found,
    coefficients: &Coefficients,
    replicates: &Replicates,
) -> Vec<Finding> {
    let share = found.starts_at_optimum as f64 / found.starts as f64;
    let few_starts = Finding::FewStarts(found.starts_at_optimum, found.starts);
    let missing = replicates.asked - replicates.converged;
    let mut all = terms(target, coefficients);
    all.extend((share < FEW_STARTS).then_some(few_starts));
    all.extend((missing > 0).then_some(Finding::Unfinished(missing, replicates.asked)));
    all.extend(few_rows(target, replicates));
    all
}

fn terms(target: &Target, coefficients: &Coefficients) -> Vec<Finding> {
    let losses = &target.data.losses;
    let typical = losses.iter().map(|l| l.abs()).sum::<f64>() / losses.len() as f64;
    let mut all = Vec::new();
    for (term, quantity) in target.form.quantities().iter().enumerate() {
        let exponent = coefficients.exponent(term);
        let size = coefficients.coefficient(term) * (-exponent * target.data.means[term]).exp();
        if size < ABSENT * typical {
            all.push(Finding::TermAbsent(quantity));
        } else if target.bounds.contains(&exponent) {
            all.push(Finding::AtBound(quantity, exponent));
        }
    }
    all.extend((coefficients.floor().abs() < ABSENT * typical).then_some(Finding::NoFloor));
    all
}

fn few_rows(target: &Target, replicates: &Replicates) -> Option<Finding> {
    let (rows, coefficients) = (target.data.columns.n, target.form.n_params());
    if rows < LEAST_ROWS * coefficients {
        return Some(Finding::TooFewRows(rows, coefficients));
    }
    let few = replicates.asked > 0 && rows < ENOUGH_ROWS * coefficients;
    few.then_some(Finding::FewRows(rows, coefficients))
}
