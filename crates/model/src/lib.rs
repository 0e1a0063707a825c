//! Tokenizers, generators and evaluators of motion on burn: their operations, their training, their weights.
//! Without the feature `train` there is no burn, and what was measured of them alone: codes and scores.
//!
//! The table has the form of that of the program; `tests/floors.rs` reads both.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`draws`] | random numbers on the host | |
//! | 1 | [`codes`] | the codes of a data set, between a tokenizer and a generator | |
//! | 1 | [`text`] | captions into frozen embeddings | |
//! | 2 | [`scores`] | embeddings of motions, and joints, into FID, R-precision and their kin | |
//! | 2 | [`ops`] | the operations of the models, with their gradients | |
//! | 2 | [`learn`] | optimiser, weights, checkpoints: one loop for whatever learns | ops |
//! | 3 | [`tokenizer`] | clips into codes | generator |
//! | 3 | [`generator`] | codes and text into a trained model and its loss, and text into codes | |
//! | 4 | [`evaluator`] | motions and captions into embeddings, and what these are worth | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod codes;
pub mod draws;
#[cfg(feature = "train")]
pub mod evaluator;
#[cfg(feature = "train")]
pub mod generator;
#[cfg(feature = "train")]
pub mod learn;
#[cfg(feature = "train")]
pub mod ops;
pub mod scores;
#[cfg(feature = "train")]
pub mod text;
#[cfg(feature = "train")]
pub mod tokenizer;

use isoflop_motion::{data, motion};
#[cfg(feature = "train")]
use isoflop_spec::{failure, progress};
use isoflop_spec::{files, spec};
