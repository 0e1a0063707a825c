//! Statistics, lines, least squares and draws that know nothing of runs.

pub(in crate::laws) mod cholesky;
pub(in crate::laws) mod engine;
pub(in crate::laws) mod least_squares;
pub(in crate::laws) mod line;
pub(in crate::laws) mod random;
pub(in crate::laws) mod stats;
