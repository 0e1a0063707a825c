//! isoflop: scaling-law experiments for autoregressive motion generation.
//!
//! Data flows one way:
//!
//! `Sweep → RunSpec → RunRecord → IsoFlopPoint → Minimum → Law → Prediction`
//!
//! Four crates lie below this one, each with its own table; their modules are re-exported here: `isoflop-laws` (tables
//! of runs into laws and predictions) and, from top to bottom, `isoflop-model` (burn's models), `isoflop-motion`
//! (clips) and `isoflop-spec` (specifications).
//!
//! Each module is on a floor (layer). It imports modules of lower floors, and on its own floor only those named in its
//! line; `tests/floors.rs` reads this table and every import.
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | [`words`] | laws and predictions as text for a terminal | |
//! | 2 | [`sweep`] | a YAML file into a checked [`sweep::Sweep`] | |
//! | 3 | [`plan`] | a sweep into priced runs, and cells dropped with their reasons | |
//! | 3 | [`rates`] | trials at several learning rates into a rule | |
//! | 4 | [`record`] | a finished run into a row of a table | |
//! | 4 | [`jobs`] | the jobs of a sweep, one file per kind | record |
//! | 5 | [`engine`] | runs jobs on this machine or a cluster | |
//! | 6 | [`figures`] | tables and laws into SVG, PNG and PDF, motions into files | |
//! | 6 | [`export`] | tables and laws into notebooks | |
//! | 6 | [`report`] | tables, laws and figures into one page of HTML | |
//!
//! # Example
//!
//! One run, from a sweep to its loss, in this process.
//!
//! ```
//! use std::ops::ControlFlow;
//! use std::time::Duration;
//!
//! use burn::tensor::Device;
//! use isoflop::codes::{SplitTokens, TokenStore, write_store};
//! use isoflop::data::{self, DataFacts, Split};
//! use isoflop::generator::{Inputs, Training, train};
//! use isoflop::learn::Checkpoints;
//! use isoflop::plan::Plan;
//! use isoflop::text::{self, TextStore, embed};
//!
//! let file = "name: first\ndata: {clips: 8, val_clips: 2, test_clips: 2}\ntokenizer: {kind: fsq}\n\
//!             grid: {models: [{n_layer: 1, n_head: 1, d_model: 8}], vocab: [16], budgets: [3e8]}\n\
//!             train: {min_steps: 1}\n";
//! let sweep = isoflop::sweep::parse("first.yaml", file, &[])?;
//! let source = data::open(&sweep.data, None)?;
//! let plan = Plan::new(&sweep, DataFacts::of(&*source));
//! let spec = &plan.runs[0].spec;
//!
//! // A tokenizer would make the codes; here every clip walks through all of them.
//! let clips: [Vec<(Vec<u32>, usize)>; 3] = Split::ALL.map(|split| {
//!     let frames = (0..source.n_clips(split)).map(|clip| source.n_frames(split, clip));
//!     frames.map(|frames| ((0..frames as u32 / 4).map(|i| i % 15).collect(), frames)).collect()
//! });
//! let splits = clips.each_ref().map(|own| SplitTokens::new(own.iter().map(|(codes, n)| (&codes[..], *n))));
//! let folder = tempfile::tempdir()?;
//! let [tokens, texts, state] = ["tokens", "text", "state"].map(|name| folder.path().join(name));
//! write_store(&tokens, &spec.codes, &splits)?;
//! embed(&*text::encoder(&sweep.text)?, &*source, &texts)?;
//!
//! let (tokens, texts) = (TokenStore::open(&tokens)?, TextStore::open(&texts)?);
//! let inputs = Inputs { tokens: &tokens, text: &texts, scales: None };
//! let checkpoints = Checkpoints { path: &state, every: Duration::from_secs(60), branch: None };
//! let training =
//!     Training { spec, inputs: &inputs, device: &Device::flex(), checkpoints: &checkpoints };
//! let trained = train(&training, &mut |_| ControlFlow::Continue(()))?;
//! assert!(trained.flops_exact > 0.0 && !trained.log.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

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
