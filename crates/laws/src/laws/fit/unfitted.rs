//! Laws of a table that hold nothing yet.

use crate::laws::file::kind::LawKind;
use crate::laws::file::laws::Laws;
use crate::laws::input::point::{IsoFlopPoint, Parameters};
use crate::laws::maths::stats::extent;

/// The laws of a table before anything was fitted, around C0 = `reference_flops`; the budgets they
/// speak of are the least and the greatest that the table holds.
pub(in crate::laws) fn unfitted(
    law: LawKind,
    names: (&str, &str),
    parameters: Parameters,
    reference_flops: f64,
    points: &[IsoFlopPoint],
) -> Laws {
    let [least, most] = extent(points.iter().map(|p| p.flops));
    Laws {
        metric: points.first().map(|point| point.metric.clone()).unwrap_or_default(),
        fitted_budgets: if least < most { vec![least, most] } else { vec![most] },
        ..Laws::unfitted(law, names, parameters, reference_flops)
    }
}
