//! How a parametric law is to be fitted.

use super::form::Form;
use super::objective::Space;
use super::search::Starts;
use crate::laws::input::error::FitError;

/// Huber's threshold between squares and absolute values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Huber {
    /// δ in units of the loss, or of its logarithm.
    Delta(f64),
    /// δ in units of the residuals' standard deviation, estimated from their median absolute
    /// deviation about a least-squares fit; 1.345 keeps 95 % of the precision that least squares
    /// has under normal noise (Huber 1981).
    Mad(f64),
    /// Least squares.
    None,
}

/// The seed by default, that of the analysis whose draws these are (see [`draws`](super::draws)).
const SEED: u64 = 42;

/// The options of [`fit_parametric`](crate::laws::fit_parametric).
#[derive(Clone, Debug, PartialEq)]
pub struct ParametricOptions {
    pub form: Form,
    pub space: Space,
    pub huber: Huber,
    pub starts: Starts,
    /// Keep the first exponent equal to the last (α1 = β, Tao et al. 2024).
    pub tied: bool,
    /// Least and largest exponent; one that ends there is no optimum, and is named.
    pub bounds: [f64; 2],
    /// Bootstrap replicates; 0 for none.
    pub bootstrap: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// The budget whose optimum single rows should not move far; `None` to ask for none.
    pub influence_at: Option<f64>,
}

impl ParametricOptions {
    /// Logarithms and 1.345 MADs for approach 3, the loss itself with a vocabulary, 1000 replicates.
    pub fn of(form: Form) -> Self {
        let space = form.default_space();
        Self {
            form,
            space,
            huber: Huber::Mad(1.345),
            starts: Starts::Projected,
            tied: false,
            bounds: [0.02, 3.0],
            bootstrap: 1000,
            seed: SEED,
            influence_at: None,
        }
    }

    pub(super) fn check(&self) -> Result<(), FitError> {
        let (Huber::Delta(delta) | Huber::Mad(delta)) = self.huber else { return Ok(()) };
        if delta.is_finite() && delta > 0.0 {
            return Ok(());
        }
        Err(FitError::BadOption {
            option: "huber",
            value: delta.to_string(),
            expected: "a finite number above 0",
        })
    }
}
