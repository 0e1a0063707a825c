//! Why a table of runs gives no frontier.

/// Why [`frontier`](super::frontier()) gave none; every message says what is wrong, and the remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FrontierError {
    #[error("run {run_id}: {field} is {value}, but it must be positive; mend or drop that row")]
    BadValue { run_id: String, field: &'static str, value: f64 },

    #[error("run {run_id}: its loss is {value}; mend or drop that row")]
    BadLoss { run_id: String, value: f64 },

    #[error(
        "the runs are no full grid: {0}; interpolation needs every model at every vocabulary with \
         the same number of checkpoints: complete the grid, or ask for no interpolation"
    )]
    NotAGrid(String),

    #[error(
        "{models} model(s), {vocabularies} vocabularies and {checkpoints} checkpoint(s) are too \
         few to interpolate between, which needs 2, 3 and 2; ask for no interpolation"
    )]
    TooSmall { models: usize, vocabularies: usize, checkpoints: usize },

    #[error(
        "a model of {params_nonvocab} non-vocabulary parameters is above 5e9, where the table of \
         widths ends; ask for no interpolation"
    )]
    NoWidth { params_nonvocab: f64 },
}
