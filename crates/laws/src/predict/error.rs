//! Why laws give no prediction.

/// Why [`predict`](super::predict) gave no prediction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PredictError {
    #[error("budget {0:e} FLOPs cannot be predicted for: give a finite number above 0")]
    BadBudget(f64),

    #[error("{laws} holds no law of {quantity}, so no optimum can be predicted; refit the sweep")]
    MissingLaw { laws: String, quantity: &'static str },

    #[error("the laws of {laws} leave the range of numbers at {budget:e} FLOPs; give a nearer one")]
    OutOfRange { laws: String, budget: f64 },

    #[error(
        "no scale of the optimum spends {budget:e} FLOPs under rule {rule}; \
         its count must grow with the model and with the tokens"
    )]
    NotProjected { budget: f64, rule: String },

    #[error("no {0} to choose from: give at least one in the options")]
    NothingToChoose(&'static str),
}
