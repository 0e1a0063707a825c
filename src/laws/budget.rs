//! Rows grouped by declared budget.

use super::{FitError, IsoFlopPoint, Parameters, check};

/// Relative distance within which two declared budgets are one: they are written by people, so
/// nothing but rounding separates equal ones.
const SAME_BUDGET: f64 = 1e-9;

/// The runs of one declared budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget<'a> {
    pub budget_flops: f64,
    pub points: Vec<&'a IsoFlopPoint>,
}

/// The budgets of a table, ascending; the rows of each in the table's order.
///
/// # Errors
/// [`FitError::BadValue`] and [`FitError::BadLoss`] name the first run with a value that no law can use;
/// N_v and V are among them, so the points must be [`Parameters::Split`].
pub fn group_budgets(points: &[IsoFlopPoint]) -> Result<Vec<Budget<'_>>, FitError> {
    group_checked(points, Parameters::Split)
}

/// [`group_budgets`] for either kind of table.
pub(super) fn group_checked(
    points: &[IsoFlopPoint],
    parameters: Parameters,
) -> Result<Vec<Budget<'_>>, FitError> {
    points.iter().try_for_each(|point| check::point(point, parameters))?;
    let mut rows: Vec<&IsoFlopPoint> = points.iter().collect();
    rows.sort_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
    let groups = rows.chunk_by(|a, b| is_same_budget(a.budget_flops, b.budget_flops));
    Ok(groups.map(|g| Budget { budget_flops: g[0].budget_flops, points: g.to_vec() }).collect())
}

/// Whether two declared budgets are the same but for rounding.
pub(super) fn is_same_budget(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_BUDGET * a.abs().max(b.abs())
}
