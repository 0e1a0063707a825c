//! Runs of every kind of generator that are stopped end on the bits of one that was not.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use burn::tensor::Device;

use crate::corpus::Corpus;
use crate::residual::{self, learning};
use crate::{masked, scalewise};
use isoflop::generator::{self, GeneratorError, Inputs, Trained, Training};
use isoflop::learn::{Checkpoints, LearnError, weights};
use isoflop::plan::RunSpec;
use isoflop::progress::Step;

/// Trains from the checkpoint, where there is one, until a step, or to the end.
fn train(
    spec: &RunSpec,
    inputs: &Inputs,
    checkpoint: &Path,
    until: Option<usize>,
) -> Result<Trained, GeneratorError> {
    let every = Duration::from_secs(3600);
    let checkpoints = Checkpoints { path: checkpoint, every, branch: None };
    let mut progress = |Step { step, .. }: Step| {
        if Some(step) == until { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let device = &Device::flex();
    generator::train(&Training { spec, inputs, device, checkpoints: &checkpoints }, &mut progress)
}

fn resumes_on_the_same_bits(spec: &RunSpec, inputs: &Inputs) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [alone, stopped] = ["alone", "stopped"].map(|name| folder.path().join(name));
    let straight = train(spec, inputs, &alone, None).unwrap();
    for stop in [1, 5, 6, 12] {
        let ended = train(spec, inputs, &stopped, Some(stop)).err();
        let at = |step| matches!(ended, Some(GeneratorError::Learn(LearnError::Stopped { step: s, .. })) if s == step);
        assert!(at(stop), "{ended:?}");
    }
    let resumed = train(spec, inputs, &stopped, None).unwrap();
    assert_eq!(resumed.test, straight.test);
    assert_eq!(resumed.log, straight.log);
    assert_eq!(resumed.flops_exact.to_bits(), straight.flops_exact.to_bits());
    assert_eq!(weights::on_host(&resumed.weights), weights::on_host(&straight.weights));
}

#[test]
fn a_scale_by_scale_run_that_was_stopped_ends_on_the_bits_of_a_straight_one() {
    let (corpus, _): (Corpus, f64) = scalewise::corpus(40);
    let spec = scalewise::spec(|own| (own.corruption, own.text_drop) = (0.3, 0.2));
    let inputs = Inputs { scales: Some(&scalewise::OneHot), ..corpus.inputs() };
    resumes_on_the_same_bits(&spec, &inputs);
}

#[test]
fn a_masked_run_that_was_stopped_ends_on_the_bits_of_a_straight_one() {
    let (corpus, _): (Corpus, f64) = masked::corpus(40);
    resumes_on_the_same_bits(&masked::spec(0.2), &corpus.inputs());
}

#[test]
fn two_stages_that_were_stopped_end_on_the_bits_of_a_straight_run() {
    let (corpus, _) = learning::corpus(40);
    resumes_on_the_same_bits(&residual::spec(0.2), &corpus.inputs());
}
