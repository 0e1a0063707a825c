//! Runs that are stopped, killed and taken up again end on the same bits.

#[path = "support/corpus.rs"]
mod corpus;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tempfile::TempDir;

use corpus::{Clips, Corpus, small_run};
use isoflop::draws::below;
use isoflop::generator::{self, GeneratorError, Trained, Training};
use isoflop::learn::weights;
use isoflop::learn::{Branch, Checkpoints, LearnError};
use isoflop::progress::{Progress, Step};
use isoflop::spec::RunSpec;

const N_VOCAB: usize = 9;
const STEPS: usize = 13;
const NEVER: Duration = Duration::from_secs(3600);

fn random_corpus() -> Corpus {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut clips = |n_clips: usize| -> Clips {
        let mut clip =
            || (0..=below(&mut rng, 12)).map(|_| below(&mut rng, N_VOCAB) as u32).collect();
        (0..n_clips).map(|_| clip()).collect()
    };
    let captions =
        |clip| (0..=clip % 3).map(|i| format!("caption {i}, {}", "la ".repeat(i))).collect();
    Corpus::new(N_VOCAB, [clips(20), clips(6), clips(8)], captions)
}

/// A run's folder, corpus and spec; steps done in it are noted.
struct Bench {
    corpus: Corpus,
    folder: TempDir,
    spec: RunSpec,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { corpus: random_corpus(), folder, spec: small_run(N_VOCAB) }
    }

    fn checkpoint(&self) -> PathBuf {
        self.folder.path().join("state.safetensors")
    }

    fn train(
        &self,
        checkpoint: &Path,
        every: Duration,
        progress: &mut Progress,
    ) -> Result<Trained, GeneratorError> {
        let checkpoints = Checkpoints { path: checkpoint, every, branch: None };
        generator::train(
            &Training {
                spec: &self.spec,
                inputs: &self.corpus.inputs(),
                device: &Device::flex(),
                checkpoints: &checkpoints,
            },
            progress,
        )
    }

    /// From the checkpoint, where there is one, to the end.
    fn to_the_end(&self, checkpoint: &Path) -> Trained {
        let mut go_on = |_: Step| ControlFlow::Continue(());
        self.train(checkpoint, NEVER, &mut go_on).expect("an ordinary run")
    }

    /// Until a stop is asked for after `stop`; the steps that were done.
    fn until(&self, stop: usize, every: Duration) -> Vec<usize> {
        let mut done = Vec::new();
        let mut progress = |Step { step, .. }: Step| {
            done.push(step);
            if step == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let stopped = self.train(&self.checkpoint(), every, &mut progress);
        assert!(
            matches!(stopped, Err(GeneratorError::Learn(LearnError::Stopped { step, .. })) if step == stop)
        );
        done
    }

    /// The message of a run that its checkpoint keeps from starting.
    fn refused(&self) -> String {
        let mut never = |_: Step| panic!("a step was done");
        let refused = self.train(&self.checkpoint(), NEVER, &mut never);
        refused.err().expect("the checkpoint cannot be read").to_string()
    }
}

/// The bits of every weight, by name.
fn weight_bits(trained: &Trained) -> Vec<(String, Vec<u32>)> {
    let weights = weights::on_host(&trained.weights).into_iter();
    let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect();
    weights.map(|(name, tensor)| (name, bits(tensor.values))).collect()
}

fn assert_same(found: &Trained, expected: &Trained) {
    assert_eq!(found.test, expected.test);
    assert_eq!(found.log, expected.log);
    assert_eq!(found.flops_exact.to_bits(), expected.flops_exact.to_bits());
    assert!(weight_bits(found) == weight_bits(expected), "weights differ");
}

/// What a run gives that nothing disturbs.
fn straight() -> Trained {
    let bench = Bench::new();
    let trained = bench.to_the_end(&bench.checkpoint());
    assert!(!bench.checkpoint().exists(), "nobody asked for a checkpoint");
    assert_eq!(trained.log.len(), bench.spec.evaluations);
    trained
}

#[test]
fn a_run_stopped_at_several_steps_ends_on_the_bits_of_a_straight_one() {
    let bench = Bench::new();
    assert_eq!(bench.until(1, NEVER), [1]);
    assert_eq!(bench.until(6, NEVER), [2, 3, 4, 5, 6]);
    assert_eq!(bench.until(7, NEVER), [7]);
    assert_eq!(bench.until(12, NEVER), [8, 9, 10, 11, 12]);
    assert_same(&bench.to_the_end(&bench.checkpoint()), &straight());
}

#[test]
fn a_stop_asked_for_at_the_last_step_finishes_the_run() {
    let bench = Bench::new();
    let mut stop_at_end = |Step { step, steps, .. }: Step| {
        if step == steps { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let finished = bench.train(&bench.checkpoint(), NEVER, &mut stop_at_end);
    assert_same(&finished.expect("it is done"), &straight());
}

#[test]
fn a_checkpoint_after_each_step_changes_nothing_and_holds_the_end() {
    let (bench, expected) = (Bench::new(), straight());
    let mut losses = Vec::new();
    let mut note = |Step { loss, .. }: Step| {
        losses.push(loss);
        ControlFlow::Continue(())
    };
    let trained = bench.train(&bench.checkpoint(), Duration::ZERO, &mut note);
    assert_same(&trained.expect("an ordinary run"), &expected);
    assert_eq!(losses.len(), STEPS);
    let mut never = |_: Step| panic!("a finished run was trained on");
    let again = bench.train(&bench.checkpoint(), NEVER, &mut never);
    assert_same(&again.expect("an ordinary run"), &expected);
}

/// What a killed process leaves is the checkpoint of the step before the one it was at.
#[test]
fn a_killed_run_goes_on_from_its_last_checkpoint() {
    let (bench, expected) = (Bench::new(), straight());
    let left_behind = |step: usize| bench.folder.path().join(format!("after-{step}"));
    let mut keep = |Step { step, .. }: Step| {
        if step > 1 {
            std::fs::copy(bench.checkpoint(), left_behind(step - 1)).expect("it is there");
        }
        ControlFlow::Continue(())
    };
    bench.train(&bench.checkpoint(), Duration::ZERO, &mut keep).expect("an ordinary run");
    for step in 1..STEPS {
        assert_same(&bench.to_the_end(&left_behind(step)), &expected);
    }
}

#[test]
fn another_seed_gives_other_bits_and_the_same_seed_the_same() {
    let mut bench = Bench::new();
    let expected = straight();
    assert_same(&bench.to_the_end(&bench.checkpoint()), &expected);
    bench.spec.seed += 1;
    let other = bench.to_the_end(&bench.checkpoint());
    let pairs = weight_bits(&other).into_iter().zip(weight_bits(&expected));
    pairs.for_each(|(other, expected)| assert_ne!(other, expected));
    assert_ne!(other.test.loss_nats, expected.test.loss_nats);
}

#[test]
fn a_checkpoint_that_is_cut_short_is_named() {
    let bench = Bench::new();
    bench.until(4, NEVER);
    let bytes = std::fs::read(bench.checkpoint()).expect("just written");
    for length in [0, 7, 8, 100, bytes.len() / 2, bytes.len() - 1] {
        std::fs::write(bench.checkpoint(), &bytes[..length]).expect("a writable folder");
        let message = bench.refused();
        assert!(message.contains("state.safetensors"), "{length} bytes: {message}");
        assert!(message.contains("remove it to have it made again"), "{length} bytes: {message}");
    }
}

#[test]
fn a_checkpoint_of_another_model_is_named_with_what_differs() {
    let mut bench = Bench::new();
    bench.until(4, NEVER);
    bench.spec.generator.shape_mut().d_ff += 8;
    let message = bench.refused();
    assert!(message.contains("state.safetensors"), "{message}");
    assert!(message.contains("blocks.0.up") && message.contains("[16, 64]"), "{message}");
}

/// A run that decays over its last four steps.
fn decaying() -> Bench {
    let bench = Bench::new();
    Bench { spec: RunSpec { decay_steps: Some(4), ..bench.spec.clone() }, ..bench }
}

/// Trains the beginning that runs of `steps` steps have in common, from a trunk of fewer steps.
fn trunk(bench: &Bench, steps: usize, from: Option<Branch>) -> PathBuf {
    let spec = RunSpec { steps, ..bench.spec.clone() }.trunk().expect("it decays");
    let place = bench.folder.path();
    let (state, own) = (place.join(format!("trunk-{steps}")), place.join("own"));
    let checkpoints = Checkpoints { path: &own, every: NEVER, branch: from };
    let mut go_on = |_: Step| ControlFlow::Continue(());
    let inputs = bench.corpus.inputs();
    generator::train_trunk(
        &Training {
            spec: &spec,
            inputs: &inputs,
            device: &Device::flex(),
            checkpoints: &checkpoints,
        },
        &state,
        &mut go_on,
    )
    .unwrap();
    state
}

#[test]
fn a_run_that_branches_off_a_trunk_ends_on_the_bits_of_one_trained_alone() {
    let bench = decaying();
    let alone = bench.to_the_end(&bench.folder.path().join("alone"));
    let first = trunk(&bench, 9, None);
    let second = trunk(&bench, bench.spec.steps, Some(Branch { state: &first, steps: 5 }));
    let own = bench.checkpoint();
    let branch = Some(Branch { state: &second, steps: 9 });
    let checkpoints = Checkpoints { path: &own, every: NEVER, branch };
    let mut told = Vec::new();
    let mut tell = |Step { step, steps, .. }: Step| {
        told.push((step, steps));
        ControlFlow::Continue(())
    };
    let inputs = bench.corpus.inputs();
    let branched = generator::train(
        &Training {
            spec: &bench.spec,
            inputs: &inputs,
            device: &Device::flex(),
            checkpoints: &checkpoints,
        },
        &mut tell,
    )
    .unwrap();
    assert_eq!(weight_bits(&branched), weight_bits(&alone));
    assert_eq!(branched.test.loss_nats.to_bits(), alone.test.loss_nats.to_bits());
    assert_eq!(branched.flops_exact, alone.flops_exact);
    assert_eq!(told, [(1, 4), (2, 4), (3, 4), (4, 4)]);
}

#[test]
fn a_trunk_of_another_step_is_refused() {
    let bench = decaying();
    let state = trunk(&bench, 9, None);
    let own = bench.checkpoint();
    let branch = Some(Branch { state: &state, steps: 9 });
    let checkpoints = Checkpoints { path: &own, every: NEVER, branch };
    let mut never = |_: Step| panic!("a step was done");
    let inputs = bench.corpus.inputs();
    let refused = generator::train(
        &Training {
            spec: &bench.spec,
            inputs: &inputs,
            device: &Device::flex(),
            checkpoints: &checkpoints,
        },
        &mut never,
    );
    let message = refused.err().expect("five steps are not nine").to_string();
    assert!(message.contains("of step 5, not 9"), "{message}");
}
