//! What a fit found, in sentences; the rooms below and above say nothing.

pub(in crate::laws) mod advice;
pub(in crate::laws) mod doubts;
pub(in crate::laws) mod flags;
pub(in crate::laws) mod forecasts;
pub(in crate::laws) mod formula;
pub(in crate::laws) mod parametric;
pub(in crate::laws) mod reasons;
pub(in crate::laws) mod warnings;
