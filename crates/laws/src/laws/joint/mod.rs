//! One smooth loss over all budgets: L(N, V, D), fitted to every cell of a sweep.
//!
//! L = e0 − e1 (1 − V^−κe)/κe + A V^κa N^−α + B V^κb N^χ D^−β, N = N_nv, and V from the middle one.
//!
//! Why these terms. A code of V values tells more of a motion, so the normalised loss falls with
//! ln V where model and data are large (e1), less and less (κe): it cannot fall below the information
//! that a motion's past and its caption hold of its next frames. How far a run is from there is the
//! model's and the data's part, as in Hoffmann et al. 2022, and both grow with V where more codes
//! have to be told apart (κ). A larger model takes smaller steps, so that a token is worth less to it
//! (χ above 0). With one vocabulary χ is left out, and it is their law.
//!
//! Where runs repeat their data, D is what repetition is worth of it (Muennighoff et al. 2023):
//! U(1 + R(1 − e^(−(D/U − 1)/R))) of D tokens of which U are distinct. R falls as N^−ρ, for a larger
//! model may learn its data by heart sooner.
//!
//! | step | file |
//! | --- | --- |
//! | coefficients, loss, derivatives | `loss` |
//! | which cells count, and how much | `weighed` |
//! | cells into coefficients | `fit`: a `problem`, solved by `maths::engine` |
//! | what a token costs, how wide a model is | `cost` |
//! | the best allocation of a budget | `optimum` |
//! | a model that is not the best one | `sized` |
//! | intervals | `bootstrap` |
//! | how far a law lies from cells it has not seen | `above` |
//! | what repeated data is worth | `repetition` |

pub(in crate::laws) mod above;
pub(in crate::laws) mod bootstrap;
pub(in crate::laws) mod cost;
pub(in crate::laws) mod fit;
pub(in crate::laws) mod law;
pub(in crate::laws) mod loss;
pub(in crate::laws) mod optimum;
pub(in crate::laws) mod problem;
pub(in crate::laws) mod repetition;
pub(in crate::laws) mod sized;
#[cfg(test)]
mod tests;
pub(in crate::laws) mod weighed;

pub(super) use above::above;
pub(super) use cost::Cost;
pub use law::JointLaw;
pub use loss::JointLoss;
