//! Rows grouped by declared budget.

use super::check;
use super::error::FitError;
use super::point::{IsoFlopPoint, Parameters};

/// Relative distance within which two declared budgets are one: they are written by people, so
/// nothing but rounding separates equal ones.
const SAME_BUDGET: f64 = 1e-9;

/// The runs of one declared budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Budget<'a> {
    pub budget_flops: f64,
    /// Those that saw as much of the data as any run of the table.
    pub points: Vec<&'a IsoFlopPoint>,
    /// Those that saw a smaller share of it.
    pub smaller: Vec<&'a IsoFlopPoint>,
}

/// The budgets of a table, ascending; the rows of each in the table's order. A budget without a run that saw
/// as much of the data as any is left out.
///
/// # Errors
/// [`FitError::BadValue`] and [`FitError::BadLoss`] name the first run with a value that no law can use;
/// N_v and V are among them, so the points must be [`Parameters::Split`].
pub fn group_budgets(points: &[IsoFlopPoint]) -> Result<Vec<Budget<'_>>, FitError> {
    group_checked(points, Parameters::Split)
}

/// [`group_budgets`] for either kind of table.
pub(in crate::laws) fn group_checked<'a>(
    points: &'a [IsoFlopPoint],
    parameters: Parameters,
) -> Result<Vec<Budget<'a>>, FitError> {
    points.iter().try_for_each(|point| check::point(point, parameters))?;
    let mut rows: Vec<&'a IsoFlopPoint> = points.iter().collect();
    rows.sort_by(|a, b| a.budget_flops.total_cmp(&b.budget_flops));
    let groups = rows.chunk_by(|a, b| is_same_budget(a.budget_flops, b.budget_flops));
    let whole = largest_share(points);
    let budget = |group: &[&'a IsoFlopPoint]| {
        let (points, smaller) = group.iter().partition(|point| point.share() == whole);
        Budget { budget_flops: group[0].budget_flops, points, smaller }
    };
    Ok(groups.map(budget).filter(|budget| !budget.points.is_empty()).collect())
}

/// The runs of a table that saw as much of the data as any of it.
pub fn of_largest_share(points: &[IsoFlopPoint]) -> Vec<IsoFlopPoint> {
    let whole = largest_share(points);
    points.iter().filter(|point| point.share() == whole).cloned().collect()
}

/// The most that a run of a table saw of the data.
pub(in crate::laws) fn largest_share(points: &[IsoFlopPoint]) -> f64 {
    points.iter().map(IsoFlopPoint::share).fold(0.0, f64::max)
}

/// Whether two declared budgets are the same but for rounding.
pub(in crate::laws) fn is_same_budget(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_BUDGET * a.abs().max(b.abs())
}
