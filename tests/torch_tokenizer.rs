//! The trainer of tokenizers in PyTorch takes the steps of the built-in one; skipped if torch is missing.

#[path = "support/torch.rs"]
mod torch;

use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use burn::tensor::Device;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tempfile::TempDir;

use isoflop::data::{self, MotionSource, Split};
use isoflop::spec::TokenizerSpec;
use isoflop::sweep::{self, Sweep};
use isoflop::text::{HashedNgrams, TextStore, embed};
use isoflop::tokenizer::{Corpus, Handover, HandoverFiles, reconstruct, taken_back, train};

/// How far apart two losses of a step may be, as a share.
const WITHIN: f64 = 1e-5;
/// The same of the joints' error of the test split in the end: codes of a latent between two may differ.
const WITHIN_IN_THE_END: f64 = 1e-3;
/// What a program ends with that TERM has stopped in order.
const STOPPED: i32 = 143;

/// A section and the size of its vocabulary.
const TOKENIZERS: [(&str, usize); 10] = [
    ("{kind: fsq, width: 16, depth: 2, batch: 4}", 240),
    // More latents a step than codes.
    ("{kind: vq, width: 16, depth: 2, batch: 8}", 64),
    // Fewer, so that codes are placed with noise.
    ("{kind: vq, width: 16, depth: 2, batch: 4}", 128),
    (
        "{kind: vq, width: 16, depth: 1, batch: 4, loss: joints, mirror: true, average: 0.9, clip_norm: 0.5, \
          weight_decay: 0.01, schedule: cosine, reset_share: 0.6}",
        32,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, \
          quantizer: {kind: multiscale, scales: [1, 2, 4]}}",
        16,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, positions: rotary, norm: pre, \
          detokenizer: context, representation: meng67, \
          quantizer: {kind: multiscale, scales: [1, 2, 4], inner: fsq, mix: 0.5}}",
        240,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, dropout: 0.1, \
          language: {at: [tokenizer, detokenizer], drop: 0.3}, \
          quantizer: {kind: multiscale, scales: [1, 2, 4]}}",
        16,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, latents: 9, positions: rotary, \
          quantizer: {kind: multiscale, scales: [1, 2, 4, 9]}}",
        16,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, norm: layer, ffn: gelu, skips: false, \
          quantizer: {kind: multiscale, scales: [1, 2, 4]}}",
        16,
    ),
    (
        "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 4, latents: 9, detokenizer: context, \
          language: {at: [detokenizer], drop: 0.3}, \
          quantizer: {kind: multiscale, scales: [1, 2, 4]}}",
        16,
    ),
];

fn sweep_with(tokenizer: &str, steps: usize) -> Sweep {
    let text = format!(
        "{{name: twin, data: {{source: procedural, clips: 24, val_clips: 4, test_clips: 8}}, \
         text: {{dim: 16, max_tokens: 12}}, tokenizer: {tokenizer}, \
         grid: {{models: [{{n_layer: 1, n_head: 1, d_model: 8}}], vocab: [16], budgets: [1e9]}}}}"
    );
    sweep::parse("twin", &text, &[format!("tokenizer.steps={steps}")]).expect("a sweep")
}

/// A tokenizer with its data, in a folder of its own.
struct Case {
    spec: TokenizerSpec,
    source: Box<dyn MotionSource>,
    text: TextStore,
    folder: TempDir,
}

impl Case {
    fn new((section, size): (&str, usize), steps: usize) -> Self {
        let (sweep, folder) = (sweep_with(section, steps), tempfile::tempdir().expect("a folder"));
        let source = data::open(&sweep.data, None).expect("procedural");
        let vectors = folder.path().join("captions.safetensors");
        embed(&HashedNgrams::new(16, 12), &*source, &vectors).expect("written");
        let text = TextStore::open(&vectors).expect("just written");
        let quantizer = sweep.tokenizer.quantizer().of_size(size).expect("a size it has");
        let spec = sweep.tokenizer.spec(quantizer, &sweep.text);
        Self { spec, source, text, folder }
    }

    fn corpus(&self) -> Corpus<'_> {
        Corpus { source: &*self.source, text: Some(&self.text) }
    }

    /// What the trainer in PyTorch is given, in a folder of this name.
    fn handed_over(&self, name: &str) -> Handover {
        let checkpoint = self.folder.path().join(name);
        std::fs::create_dir_all(&checkpoint).expect("a writable folder");
        let vectors = self.folder.path().join("captions.safetensors");
        let text = self.spec.architecture.language().map(|_| vectors);
        let out = checkpoint.join("result.json");
        let files = HandoverFiles { out, checkpoint, text, checkpoint_s: 600.0 };
        Handover::write(&self.spec, &self.corpus(), &Device::flex(), files).expect("written")
    }
}

/// The trainer, to be started.
fn program(python: &Path, handover: &Handover) -> Command {
    let spec = handover.files.checkpoint.join("trainer.json");
    std::fs::write(&spec, serde_json::to_string(handover).expect("plain values")).expect("written");
    let mut command = Command::new(python);
    command.args(["-m", "isoflop.torch.tokenizer", "--device", "cpu", "--spec"]).arg(&spec);
    command
        .arg("--out")
        .arg(&handover.files.out)
        .arg("--checkpoint")
        .arg(&handover.files.checkpoint);
    torch::with_package(&mut command);
    command
}

/// Trains to the end; the loss of each step, and where the weights lie.
fn trained(python: &Path, handover: &Handover) -> (Vec<f64>, PathBuf) {
    let ended = program(python, handover).output().expect("python can be started");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let losses = std::fs::read(handover.files.checkpoint.join("losses.json")).expect("left there");
    let weights = handover.files.checkpoint.join("trained.safetensors");
    (serde_json::from_slice(&losses).expect("numbers"), weights)
}

/// How far apart both trainers are: in the loss of a step at most, and in the joints' error in the end.
fn apart(case: &Case, python: &Path) -> [f64; 2] {
    let (spec, corpus, device) = (&case.spec, case.corpus(), Device::flex());
    let mut own = Vec::new();
    let mut note = |step: isoflop::progress::Step| {
        own.push(step.loss);
        ControlFlow::Continue(())
    };
    let built_in = train(spec, &corpus, &device, None, &mut note).expect("it trains");
    let (losses, weights) = trained(python, &case.handed_over("checkpoint"));
    let torch = taken_back(spec, &corpus, &device, &weights).expect("weights of the same names");
    assert_eq!(losses.len(), own.len());
    let share = |a: f64, b: f64| (a - b).abs() / a.abs();
    let worst = own.iter().zip(losses).map(|(&a, b)| share(a, b)).fold(0.0, f64::max);
    let [a, b] = [built_in, torch].map(|tokenizer| {
        reconstruct(&tokenizer, &corpus, Split::Test, 0.0).expect("a test split").mpjpe_mm
    });
    [worst, share(a, b)]
}

#[test]
fn both_trainers_take_the_same_steps() {
    let Some(python) = torch::python() else { return };
    let mut far = Vec::new();
    for tokenizer in TOKENIZERS {
        let [losses, end] = apart(&Case::new(tokenizer, 20), &python);
        let said = format!("losses {losses:.1e} apart, joints {end:.1e}: {tokenizer:?}");
        println!("{said}");
        if losses > WITHIN || end > WITHIN_IN_THE_END {
            far.push(said);
        }
    }
    assert!(far.is_empty(), "{}", far.join("\n"));
}

/// With codes that noise places, an average and dropout: all that a checkpoint has to hold.
#[test]
fn a_stopped_trainer_goes_on_with_the_same_bits() {
    let Some(python) = torch::python() else { return };
    let section = "{kind: transformer, width: 16, heads: 2, latent: 8, batch: 2, dropout: 0.1, \
                   quantizer: {kind: vq}, reset_share: 0}";
    let case = Case::new((section, 64), 200);
    let (straight, _) = trained(&python, &case.handed_over("straight"));
    let handover = case.handed_over("stopped");
    let started = program(&python, &handover).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let mut child = started.expect("python can be started");
    let mut line = String::new();
    let mut lines = BufReader::new(child.stdout.take().expect("piped"));
    lines.read_line(&mut line).expect("a line of progress");
    kill(Pid::from_raw(child.id() as i32), Signal::SIGTERM).expect("it runs");
    assert_eq!(child.wait().expect("it ends").code(), Some(STOPPED), "after {line}");
    assert!(handover.files.checkpoint.join("state.pt").exists());
    let (resumed, _) = trained(&python, &handover);
    assert_eq!(straight, resumed);
}
