//! Parametric laws of the loss, approach 3: one equation through every run.
//!
//! | step | file |
//! | --- | --- |
//! | the forms and their coefficients | `form` |
//! | points into centred columns | `data` |
//! | objective, gradient, Hessian | `objective`, on `lanes`; in the free parameters, `problem` |
//! | starts by variable projection | `search`, `inner` |
//! | downhill to the last digit | `newton` |
//! | intervals | `bootstrap` |
//! | rows that an optimum hangs on | `influence` |
//! | all of it | [`fit_parametric`] |
//! | the laws that follow | [`parametric_laws`] |
//! | the best allocation of a budget | [`optimum()`] |

mod bootstrap;
mod data;
mod draws;
mod fit;
mod form;
mod influence;
mod inner;
mod lanes;
mod laws;
mod newton;
mod objective;
mod optimum;
mod options;
mod problem;
mod search;
mod text;
mod types;
mod vector;
mod warnings;

pub use fit::fit_parametric;
pub use form::{Coefficients, Form};
pub use influence::Influence;
pub use laws::around;
pub use laws::parametric_laws;
pub use objective::Space;
pub use optimum::{Optimum, optimum, vocab_exponent};
pub use options::{Huber, ParametricOptions};
pub use search::Starts;
pub use text::parametric_text;
pub use types::Parametric;

#[cfg(test)]
mod tests;
