//! [`Approach1Options`]: how the laws of a frontier are to be fitted.

use crate::laws::input::point::Parameters;

/// The options of [`approach1`](super::approach1()).
#[derive(Clone, Debug, PartialEq)]
pub struct Approach1Options {
    pub name: String,
    pub flops_rule: String,
    pub parameters: Parameters,
    /// Read training curves between their measured points.
    pub interpolate: bool,
    /// Huber's δ in units of the residuals' MAD; least squares where absent.
    pub huber: Option<f64>,
    pub bootstrap: usize,
    pub seed: u64,
}
