//! Training of a run by itself.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use burn::tensor::Device;

use isoflop::generator::{self, GeneratorError, Inputs, Trained, Training};
use isoflop::learn::Checkpoints;
use isoflop::progress::Step;
use isoflop::spec::RunSpec;

/// Trains from the first step to the end.
pub fn train(spec: &RunSpec, inputs: &Inputs) -> Result<Trained, GeneratorError> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    train_from(&folder.path().join("state"), spec, inputs, |_| ControlFlow::Continue(()))
}

/// Trains from the checkpoint, where there is one, for as long as `progress` lets it.
pub fn train_from(
    checkpoint: &Path,
    spec: &RunSpec,
    inputs: &Inputs,
    mut progress: impl FnMut(Step) -> ControlFlow<()>,
) -> Result<Trained, GeneratorError> {
    let every = Duration::from_secs(3600);
    let checkpoints = Checkpoints { path: checkpoint, every, branch: None };
    let device = &Device::flex();
    generator::train(&Training { spec, inputs, device, checkpoints: &checkpoints }, &mut progress)
}
