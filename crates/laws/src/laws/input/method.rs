//! [`MinimumMethod`]: how the minimum of one budget is found.

use schemars::JsonSchema;
use std::fmt;

use serde::{Deserialize, Serialize};

/// How the minimum of one budget was found.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum MinimumMethod {
    /// The best run (ScaMo).
    #[default]
    Argmin,
    /// A quadratic in ln N_nv through the best run of each size (Hoffmann et al. 2022, approach 2).
    Parabola,
    /// A cubic in ln N_nv, the parabola's check.
    Cubic,
    /// Akima's local spline in ln N_nv, which no far-off size can bend.
    Akima,
    /// A joint quadratic in (ln N_nv, ln N_v).
    Surface,
}

impl fmt::Display for MinimumMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}
