//! Why laws give no prediction.

use crate::laws::text::count;

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
        "the joint law of {laws} has no optimum at {budget:e} FLOPs between the {what} {} and {}, 8 times \
         below what was tried and far above it: give a budget nearer to the runs, or add runs on both sides of \
         the best {what} of each budget", count(*.low), count(*.high)
    )]
    NoOptimum { laws: String, budget: f64, what: &'static str, low: f64, high: f64 },

    #[error(
        "no scale of the optimum spends {budget:e} FLOPs under rule {rule}; \
         its count must grow with the model and with the tokens"
    )]
    NotProjected { budget: f64, rule: String },

    #[error(
        "{laws} knows the loss of compute-optimal models only, not that of any N and D; fit a law that \
         does: `isoflop fit TABLE --law approach3 --out laws.json`, or `isoflop fit RESULTS` of a \
         sweep with four budgets or more, which gives a joint law"
    )]
    NoLossLaw { laws: String },

    #[error("the law of {laws} tells the vocabulary apart: --params is N_nv, and it needs {needs}")]
    NoVocabulary { laws: String, needs: &'static str },

    #[error("the law of {laws} knows no vocabulary: leave out --vocab and --params-vocab")]
    VocabularyUnknown { laws: String },

    #[error("no {0} to choose from: give at least one in the options")]
    NothingToChoose(&'static str),
}
