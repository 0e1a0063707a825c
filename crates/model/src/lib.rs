//! Tokenizers, generators and evaluators of motion on burn: their operations, their training, their weights.
//!
//! The table has the form of that of the program; `tests/floors.rs` reads both.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`codes`] | the codes of a data set, between a tokenizer and a generator | |
//! | 1 | [`text`] | captions into frozen embeddings | |
//! | 2 | [`ops`] | the operations of the models, with their gradients | |
//! | 2 | [`learn`] | optimiser, weights, checkpoints: one loop for whatever learns | ops |
//! | 3 | [`tokenizer`] | clips into codes | generator |
//! | 3 | [`generator`] | codes and text into a trained model and its loss, and text into codes | |
//! | 3 | [`scores`] | embeddings of motions, and joints, into FID, R-precision and their kin | |
//! | 4 | [`evaluator`] | motions and captions into embeddings, and what these are worth | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod codes;
pub mod evaluator;
pub mod generator;
pub mod learn;
pub mod ops;
pub mod scores;
pub mod text;
pub mod tokenizer;

use isoflop_motion::{data, motion};
use isoflop_spec::{failure, files, progress, spec};
