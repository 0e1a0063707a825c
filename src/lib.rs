//! isoflop: scaling-law experiments for autoregressive motion generation.
//!
//! Data flows one way:
//!
//! `Sweep → RunSpec → RunRecord → IsoFlopPoint → Minimum → Law → Prediction`
//!
//! Below this crate lie four others, each with a table of its own; their modules are passed on here:
//! `isoflop-laws` (tables of runs into laws and predictions) and, the upper on the lower, `isoflop-model`
//! (burn's models), `isoflop-motion` (clips) and `isoflop-spec` (what is trained).
//!
//! Each module stands on a floor. It imports modules of lower floors, and of its own floor only
//! those named in its line; `tests/floors.rs` reads this table and every import.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`words`] | laws and predictions in words, for a terminal | |
//! | 2 | [`sweep`] | a YAML file into a checked [`sweep::Sweep`] | |
//! | 3 | [`plan`] | a sweep into priced runs, and cells dropped with their reasons | |
//! | 3 | [`rates`] | trials at several learning rates into a rule | |
//! | 4 | [`record`] | a finished run into a row of a table | |
//! | 4 | [`jobs`] | what there is to do: a file a kind of job | record |
//! | 5 | [`engine`] | who brings jobs to their end: this machine, or a cluster | |
//! | 6 | [`figures`] | tables and laws into SVG, PNG and PDF, motions into files | |
//! | 6 | [`export`] | tables and laws into notebooks | |
//! | 6 | [`report`] | tables, laws and figures into one page of HTML | |

// What goes wrong is an error, and what there is to say is a value: the program writes it.
#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

#[cfg(not(unix))]
compile_error!(
    "isoflop needs a Unix: it ends what hangs, and outlives what is killed, by signals and process groups"
);

#[cfg(feature = "train")]
pub mod engine;
pub mod export;
pub mod figures;
pub mod jobs;
pub mod plan;
pub mod rates;
pub mod record;
pub mod report;
pub mod sweep;
pub mod words;

pub use isoflop_laws::{laws, predict, table};
pub use isoflop_model::{codes, draws, scores};
#[cfg(feature = "train")]
pub use isoflop_model::{evaluator, generator, learn, ops, text, tokenizer};
pub use isoflop_motion::{data, motion};
pub use isoflop_spec::{failure, files, machine, progress, spec, units};
