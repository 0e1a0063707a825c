//! Runs of every kind of generator that are stopped end on the bits of one that was not.

use std::ops::ControlFlow;
use std::path::Path;

use crate::corpus::Corpus;
use crate::residual::{self, learning};
use crate::trained::{train, train_from};
use crate::{masked, scalewise};
use isoflop::generator::{GeneratorError, Inputs, Trained};
use isoflop::learn::{LearnError, weights};
use isoflop::spec::RunSpec;

/// Trains from the checkpoint, where there is one, until a step.
fn stop_at(
    step: usize,
    checkpoint: &Path,
    spec: &RunSpec,
    inputs: &Inputs,
) -> Result<Trained, GeneratorError> {
    train_from(checkpoint, spec, inputs, |now| {
        if now.step == step { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
}

fn resumes_on_the_same_bits(spec: &RunSpec, inputs: &Inputs) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let stopped = folder.path().join("stopped");
    let straight = train(spec, inputs).unwrap();
    for stop in [1, 5, 6, 12] {
        let ended = stop_at(stop, &stopped, spec, inputs).err();
        let at = |step| matches!(ended, Some(GeneratorError::Learn(LearnError::Stopped { step: s, .. })) if s == step);
        assert!(at(stop), "{ended:?}");
    }
    let resumed = train_from(&stopped, spec, inputs, |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(resumed.test, straight.test);
    assert_eq!(resumed.log, straight.log);
    assert_eq!(resumed.flops_exact.to_bits(), straight.flops_exact.to_bits());
    assert_eq!(weights::on_host(&resumed.weights), weights::on_host(&straight.weights));
}

#[test]
fn a_scale_by_scale_run_that_was_stopped_ends_on_the_bits_of_a_straight_one() {
    let (corpus, _): (Corpus, f64) = scalewise::corpus(40);
    let spec = scalewise::spec(|own| (own.corruption, own.text_drop) = (0.3, 0.2));
    resumes_on_the_same_bits(&spec, &scalewise::inputs(&corpus));
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
