//! Generators: models of codes given text. A folder a kind, each with a [`Kind`] and so a [`Generator`].
//!
//! [`of`] is the one place that tells kinds apart.
//!
//! # Example
//!
//! ```
//! use std::ops::ControlFlow;
//! use std::time::Duration;
//!
//! use burn::tensor::Device;
//! use isoflop_model::codes::{SplitTokens, TokenStore, write_store};
//! use isoflop_motion::data::{self, DataFacts, Split};
//! use isoflop_model::generator::{Inputs, Training, train};
//! use isoflop_model::learn::Checkpoints;
//! use isoflop::plan::Plan;
//! use isoflop_model::text::{self, TextStore, embed};
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

pub mod autoregressive;
mod every_kind;
mod kind;
pub mod masked;
mod probed;
mod sampling;
pub mod scalewise;
pub(crate) mod stack;
mod trained;

use std::path::Path;

pub use trained::{
    GeneratorError, Inputs, LogLine, ScaleInputs, SplitLoss, Sums, Trained, losses_by_block,
};

pub use every_kind::Generator;
pub use kind::{Kind, MOST_PROBED_PARAMS, Network, Objective, Probe, Training, learning_rate};
pub use sampling::{Choices, Draw, Edit, Prompt, Sampled, Sampler, Sampling, StreamForm};

use crate::progress::Progress;
use crate::spec::GeneratorSpec;
use crate::spec::RunSpec;

/// The generator of a run.
pub fn of(spec: &RunSpec) -> &'static dyn Generator {
    match spec.generator {
        GeneratorSpec::Autoregressive(_) => &autoregressive::Autoregressive,
        GeneratorSpec::Masked(_) if spec.codes.scales.len() == 1 => &masked::Masked,
        GeneratorSpec::Masked(_) => &masked::residual::MaskedResidual,
        GeneratorSpec::Scalewise(_) => &scalewise::Scalewise,
    }
}

/// [`Generator::train`] of the generator of a run.
///
/// # Errors
/// As there.
pub fn train(training: &Training, progress: &mut Progress) -> Result<Trained, GeneratorError> {
    of(training.spec).train(training, progress)
}

/// [`Generator::train_trunk`] of the generator of a run.
///
/// # Errors
/// As there.
pub fn train_trunk(
    training: &Training,
    state: &Path,
    progress: &mut Progress,
) -> Result<(), GeneratorError> {
    of(training.spec).train_trunk(training, state, progress)
}
