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
//! | what speaks against it | `findings` |
//! | all of it | [`fit_parametric`](crate::laws::fit_parametric) |
//! | the laws that follow | [`parametric_laws`](crate::laws::parametric_laws) |
//! | the best allocation of a budget | [`optimum()`](crate::laws::optimum()) |

pub(in crate::laws) mod bootstrap;
pub(in crate::laws) mod data;
pub(in crate::laws) mod draws;
pub(in crate::laws) mod findings;
pub(in crate::laws) mod fit;
pub(in crate::laws) mod form;
pub(in crate::laws) mod influence;
pub(in crate::laws) mod inner;
pub(in crate::laws) mod lanes;
pub(in crate::laws) mod newton;
pub(in crate::laws) mod objective;
pub(in crate::laws) mod optimum;
pub(in crate::laws) mod options;
pub(in crate::laws) mod problem;
pub(in crate::laws) mod search;
pub(in crate::laws) mod types;
pub(in crate::laws) mod vector;

#[cfg(test)]
mod tests;
