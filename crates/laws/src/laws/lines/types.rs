//! Laws through minima, and what they say of budgets that they have not seen.

use serde::{Deserialize, Serialize};

use crate::laws::input::quantities::PerQuantity;

/// log10 y = `log10_coefficient` + `exponent` · log10 x.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PowerLaw {
    pub log10_coefficient: f64,
    pub exponent: f64,
    /// ln y at the reference budget of [`Laws::reference_flops`](crate::laws::Laws::reference_flops); the well-determined intercept.
    /// For N_v in N_nv it is ln N_v at the geometric mean of the fitted N_nv.
    pub ln_at_reference: f64,
    /// 1 − RSS/TSS in ln y; 0 where y does not vary, and where a published law gives none (`n` 0).
    pub r2: f64,
    /// 95 % bootstrap percentile interval; absent where too few points allow none.
    pub exponent_ci95: Option<[f64; 2]>,
    pub ln_at_reference_ci95: Option<[f64; 2]>,
    pub log10_coefficient_ci95: Option<[f64; 2]>,
    /// Points fitted; 0 for a published law.
    pub n: usize,
}

impl PowerLaw {
    /// R², where it says something: a line goes through any two points.
    pub fn told_r2(&self) -> Option<f64> {
        (self.n > 2).then_some(self.r2)
    }
}

/// L_u = `slope_per_decade` · log10 C + `intercept` (ScaMo Eq. 14).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LogLaw {
    pub slope_per_decade: f64,
    pub intercept: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    pub slope_ci95: Option<[f64; 2]>,
    pub intercept_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl LogLaw {
    /// R² and AIC, where they say something: a line goes through any two points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 2).then_some([self.r2, self.aic])
    }
}

/// L_u = `floor` + `coefficient` · (C / C0)^(−`exponent`), C0 = [`Laws::reference_flops`](crate::laws::Laws::reference_flops).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FloorLaw {
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
    pub r2: f64,
    pub aic: f64,
    /// Predicted minus measured at the held-out budget, in nats.
    pub held_out_error: Option<f64>,
    pub floor_ci95: Option<[f64; 2]>,
    pub coefficient_ci95: Option<[f64; 2]>,
    pub exponent_ci95: Option<[f64; 2]>,
    pub n: usize,
}

impl FloorLaw {
    /// R² and AIC, where they say something: some such law goes through almost any three points.
    pub fn goodness(&self) -> Option<[f64; 2]> {
        (self.n > 3).then_some([self.r2, self.aic])
    }
}

/// The two loss laws, always side by side.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossLaws {
    pub log: Option<LogLaw>,
    pub floor: Option<FloorLaw>,
}

/// The power laws of the optimum in C (ScaMo Eq. 9); absent where not identifiable.
pub type PowerLaws = PerQuantity<PowerLaw>;

/// Exponents in C of the size, N_v and D.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exponents {
    /// Of N_nv, or N.
    pub size: Option<f64>,
    pub params_vocab: Option<f64>,
    pub tokens: Option<f64>,
}

/// Exponents under another convention or another kind of minimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sensitivity {
    /// What was changed, for a person: "minima: cubic", "flops: 6nd".
    pub variant: String,
    pub exponent_vocab: Option<f64>,
    pub exponent_nonvocab: Option<f64>,
    /// Of N, where the size is one number; then the two above are absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exponent_params: Option<f64>,
    pub exponent_tokens: Option<f64>,
    pub slope_per_decade: Option<f64>,
}

/// How a budget was kept from the laws that predict it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ValidationKind {
    /// The laws are fitted to all other fitted budgets.
    LeaveOneOut,
    /// The laws are fitted to the smaller budgets.
    RollForward,
}

/// What laws that had not seen a budget say of it, against its measured minimum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Validation {
    pub kind: ValidationKind,
    pub budget_flops: f64,
    /// How many budgets the laws were fitted to.
    pub n_fitted: usize,
    /// Predicted less measured loss by the log law, in nats.
    pub log_error: f64,
    /// The same by the floor law, where three budgets or more give one.
    pub floor_error: Option<f64>,
    /// Predicted over measured N, where N_nv and N_v are not told apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub params_ratio: Option<f64>,
    /// Predicted over measured N_nv.
    pub params_nonvocab_ratio: Option<f64>,
    /// Predicted over measured N_v, where several vocabularies were tried.
    pub params_vocab_ratio: Option<f64>,
    /// Predicted over measured D.
    pub tokens_ratio: f64,
}
