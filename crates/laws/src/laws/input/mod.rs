//! What a fit is given: runs, how it is asked for, and the runs gathered by budget and cell.

pub(in crate::laws) mod budget;
pub(in crate::laws) mod cell;
pub(in crate::laws) mod check;
pub(in crate::laws) mod error;
pub(in crate::laws) mod lost_shares;
pub(in crate::laws) mod method;
pub(in crate::laws) mod metric;
pub(in crate::laws) mod options;
pub(in crate::laws) mod point;
pub(in crate::laws) mod quantities;
