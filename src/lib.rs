//! isoflop: scaling-law experiments for autoregressive motion generation.
//!
//! Data flows one way:
//!
//! `Sweep → RunSpec → RunRecord → IsoFlopPoint → Minimum → Law → Prediction`
//!
//! Each module stands on a floor. It imports modules of lower floors, and of its own floor only
//! those named in its line; `tests/floors.rs` reads this table and every import.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`units`] | numbers and amounts of memory as people write them | |
//! | 1 | [`failure`] | what can go wrong with a job, as a type | |
//! | 1 | [`machine`] | memory of this machine, and kills for the lack of it; GPUs by name | |
//! | 1 | [`files`] | files written whole, mapped, or set aside | failure |
//! | 1 | [`progress`] | steps, pieces of work, requests to stop | failure, files |
//! | 1 | [`words`] | laws and predictions in words, for a terminal | |
//! | 2 | [`spec`] | closed descriptions of what is trained: hashed, free of burn | |
//! | 2 | [`sweep`] | a YAML file into a checked [`sweep::Sweep`] | spec |
//! | 3 | [`motion`] | joints into features and back, into BVH, from other skeletons; the procedural source | |
//! | 3 | [`data`] | a folder or the generator into clips with captions; other files into such a folder | motion |
//! | 3 | [`text`] | captions into frozen embeddings | data |
//! | 3 | [`codes`] | the codes of a data set, between a tokenizer and a generator | data |
//! | 4 | [`plan`] | a sweep into priced runs, and cells dropped with their reasons | |
//! | 4 | [`rates`] | trials at several learning rates into a rule | |
//! | 5 | [`ops`] | the operations of the models, with their gradients | |
//! | 5 | [`learn`] | optimiser, weights, checkpoints: one loop for whatever learns | ops |
//! | 5 | [`tokenizer`] | clips into codes | learn, ops |
//! | 5 | [`generator`] | codes and text into a trained model and its loss, and text into codes | learn, ops |
//! | 5 | [`scores`] | embeddings of motions, and joints, into FID, R-precision and their kin | learn |
//! | 5 | [`evaluator`] | motions and captions into embeddings, and what these are worth | generator, learn, ops, scores |
//! | 6 | [`record`] | a finished run into a row of a table | |
//! | 6 | [`jobs`] | what there is to do: a file a kind of job | record |
//! | 7 | [`engine`] | who brings jobs to their end: this machine, or a cluster | |
//! | 8 | [`figures`] | tables and laws into SVG, PNG and PDF, motions into files | |
//! | 8 | [`export`] | tables and laws into notebooks | |
//! | 8 | [`report`] | tables, laws and figures into one page of HTML | |

// What goes wrong is an error, and what there is to say is a value: the program writes it.
#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

#[cfg(not(unix))]
compile_error!(
    "isoflop needs a Unix: it ends what hangs, and outlives what is killed, by signals and process groups"
);

pub mod codes;
pub mod data;
pub mod engine;
pub mod evaluator;
pub mod export;
pub mod failure;
pub mod figures;
pub mod files;
pub mod generator;
pub mod jobs;
pub mod learn;
pub mod machine;
pub mod motion;
pub mod ops;
pub mod plan;
pub mod progress;
pub mod rates;
pub mod record;
pub mod report;
pub mod scores;
pub mod spec;
pub mod sweep;
pub mod text;
pub mod tokenizer;
pub mod units;
pub mod words;

pub use isoflop_laws::{laws, predict, table};
