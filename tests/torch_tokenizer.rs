//! The trainer of tokenizers in PyTorch takes the steps of the built-in one; skipped if torch is missing.

#[path = "support/torch.rs"]
mod torch;

use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;

use burn::tensor::Device;

use isoflop::data::{self, MotionSource};
use isoflop::spec::TokenizerSpec;
use isoflop::sweep::{self, Sweep};
use isoflop::text::{HashedNgrams, TextStore, embed};
use isoflop::tokenizer::{Corpus, Handover, HandoverFiles, taken_back, train};

/// How far apart two losses of a step may be, as a share.
const WITHIN: f64 = 1e-5;

/// A section and the size of its vocabulary.
const TOKENIZERS: [(&str, usize); 7] = [
    ("{kind: fsq, width: 16, depth: 2, batch: 4}", 240),
    // More latents a step than codes.
    ("{kind: vq, width: 16, depth: 2, batch: 8}", 64),
    // Fewer, so that codes are placed with noise.
    ("{kind: vq, width: 16, depth: 2, batch: 4}", 128),
    (
        "{kind: vq, width: 16, depth: 1, batch: 4, loss: joints, mirror: true, average: 0.9, clip_norm: 0.5, \
          weight_decay: 0.01, schedule: cosine, reset_share: 0.025}",
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
];

fn sweep_with(tokenizer: &str) -> Sweep {
    let text = format!(
        "{{name: twin, data: {{source: procedural, clips: 24, val_clips: 4, test_clips: 8}}, \
         text: {{dim: 16, max_tokens: 12}}, tokenizer: {tokenizer}, \
         grid: {{models: [{{n_layer: 1, n_head: 1, d_model: 8}}], vocab: [16], budgets: [1e9]}}}}"
    );
    sweep::parse("twin", &text, &["tokenizer.steps=20".to_string()]).expect("a sweep")
}

/// The same tokenizer by both trainers: the loss of each step.
struct Twins {
    losses: [Vec<f64>; 2],
}

fn losses_of_torch(folder: &Path, python: &Path, handover: &Handover) -> Vec<f64> {
    let spec = folder.join("trainer.json");
    std::fs::write(&spec, serde_json::to_string(handover).expect("plain values")).expect("written");
    let mut command = Command::new(python);
    command.args(["-m", "isoflop.torch.tokenizer", "--device", "cpu", "--spec"]).arg(&spec);
    command.arg("--out").arg(&handover.out).arg("--checkpoint").arg(&handover.checkpoint);
    let ended = torch::with_package(&mut command).output().expect("python can be started");
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let losses = std::fs::read(handover.checkpoint.join("losses.json")).expect("left there");
    serde_json::from_slice(&losses).expect("numbers")
}

fn twins(spec: &TokenizerSpec, corpus: &Corpus, text: &Path, python: &Path) -> Twins {
    let (folder, device) = (tempfile::tempdir().expect("a folder"), Device::flex());
    let mut own = Vec::new();
    let mut note = |step: isoflop::progress::Step| {
        own.push(step.loss);
        ControlFlow::Continue(())
    };
    train(spec, corpus, &device, None, &mut note).expect("it trains");
    let files = HandoverFiles {
        out: folder.path().join("result.json"),
        checkpoint: folder.path().to_path_buf(),
        text: spec.architecture.language().map(|_| text.to_path_buf()),
        checkpoint_s: 600.0,
    };
    let handover = Handover::write(spec, corpus, &device, files).expect("it can be written");
    let torch = losses_of_torch(folder.path(), python, &handover);
    let weights = handover.checkpoint.join("trained.safetensors");
    let back = taken_back(spec, corpus, &device, &weights).expect("weights of the same names");
    assert_eq!(back.n_vocab(), spec.n_vocab());
    Twins { losses: [own, torch] }
}

/// The largest difference of two losses of a step, as a share.
fn apart([own, torch]: &[Vec<f64>; 2]) -> f64 {
    let apart = own.iter().zip(torch).map(|(a, b)| (a - b).abs() / a.abs());
    apart.fold(0.0, f64::max)
}

#[test]
fn both_trainers_take_the_same_steps() {
    let Some(python) = torch::python() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let vectors = folder.path().join("captions.safetensors");
    let mut far = Vec::new();
    for (section, size) in TOKENIZERS {
        let sweep = sweep_with(section);
        let source: Box<dyn MotionSource> = data::open(&sweep.data, None).expect("procedural");
        embed(&HashedNgrams::new(16, 12), &*source, &vectors).expect("written");
        let text = TextStore::open(&vectors).expect("just written");
        let corpus = Corpus { source: &*source, text: Some(&text) };
        let quantizer = sweep.tokenizer.quantizer().of_size(size).expect("a size it has");
        let spec = sweep.tokenizer.spec(quantizer, &sweep.text);
        let Twins { losses } = twins(&spec, &corpus, &vectors, &python);
        assert_eq!(losses.each_ref().map(Vec::len), [20, 20]);
        let share = apart(&losses);
        println!("{share:.1e} apart: V {size}, {section}");
        if share > WITHIN {
            far.push(format!("{share:.1e} apart: {section}\n{losses:?}"));
        }
    }
    assert!(far.is_empty(), "{}", far.join("\n"));
}
