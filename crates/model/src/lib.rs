//! Tokenizers, generators and evaluators of motion on burn: operations, training, weights. Without the feature `train`
//! there is no burn, and only codes and scores remain.
//!
//! The table has the same form as the program's; `tests/floors.rs` reads both.
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | [`draws`] | random numbers on the host | |
//! | 1 | [`codes`] | the codes of a data set, between a tokenizer and a generator | |
//! | 1 | [`text`] | captions into frozen embeddings, and the lengths of motions from them | draws |
//! | 2 | [`scores`] | FID, R-precision and similar scores from embeddings and joints | |
//! | 2 | [`ops`] | the operations of the models, with their gradients | |
//! | 2 | [`learn`] | the training loop: optimiser, weights, checkpoints | ops |
//! | 3 | [`tokenizer`] | clips into codes | generator |
//! | 3 | [`generator`] | codes and text into a trained model and its loss, and text into codes | |
//! | 4 | [`evaluator`] | embeddings of motions and captions, with gates | |

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
