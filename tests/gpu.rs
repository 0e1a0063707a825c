//! Training on a GPU, held to training on the processor: `cargo test --release --features wgpu --test
//! gpu`. Mesa's llvmpipe, a Vulkan driver in software, will do (the package `mesa-vulkan-drivers`). Of several devices in
//! a build, `cuda` is tested before `wgpu`, and `vulkan` last.
#![cfg(any(feature = "wgpu", feature = "vulkan", feature = "cuda"))]

#[path = "support/corpus.rs"]
mod corpus;

use std::ops::ControlFlow;
use std::time::Duration;

use burn::tensor::{Device, FloatDType};
use corpus::{Clips, Corpus, small_run};
use isoflop::data::{Procedural, ProceduralOptions};
use isoflop::generator::{self, Training};
use isoflop::learn::Checkpoints;
use isoflop::ops::{DeviceName, check_products};
use isoflop::progress::Step;
use isoflop::spec::RunSpec;
use isoflop::spec::{Ffn, Precision};
use isoflop::spec::{QuantizerSpec, TextSpec, TokenizerSection};
use isoflop::tokenizer;

/// The allowed difference of losses in single precision, as a share: `cuda` multiplies in TF32, whose fraction has as
/// many bits as that of `f16`.
const SINGLE: f64 = if cfg!(feature = "cuda") { 1e-2 } else { 1e-5 };

fn gpu() -> Device {
    let name = if cfg!(feature = "cuda") {
        DeviceName::Cuda
    } else if cfg!(feature = "wgpu") {
        DeviceName::Wgpu
    } else {
        DeviceName::Vulkan
    };
    name.open().expect("a device of this build")
}

/// The losses of all steps, and at the end that on the test split.
fn losses(spec: &RunSpec, device: &Device) -> Vec<f64> {
    let lengths = [5, 1, 8, 2, 11, 3, 3, 7];
    let mut next = 0..;
    let clips: Clips = lengths.map(|n| next.by_ref().take(n).collect()).into();
    let captions = |clip| vec![format!("clip {clip}")];
    let corpus = Corpus::new(40, [clips.clone(), clips.clone(), clips], captions);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("state");
    let checkpoints = Checkpoints { path: &path, every: Duration::from_secs(3600), branch: None };
    let mut losses = Vec::new();
    let mut note = |Step { loss, .. }: Step| {
        losses.push(loss);
        ControlFlow::Continue(())
    };
    let trained = generator::train(
        &Training { spec, inputs: &corpus.inputs(), device, checkpoints: &checkpoints },
        &mut note,
    );
    losses.push(trained.expect("an ordinary run").test.loss_nats);
    losses
}

/// The largest difference, as a share.
fn furthest(found: &[f64], right: &[f64]) -> f64 {
    assert_eq!(found.len(), right.len());
    let off = found.iter().zip(right).map(|(found, right)| ((found - right) / right).abs());
    off.fold(0.0, |most, off| if off <= most { most } else { off })
}

#[test]
fn products_are_right() {
    check_products(&gpu()).expect("a device that multiplies");
}

#[test]
fn models_train_as_on_the_processor() {
    for ffn in [Ffn::SwiGlu, Ffn::Gelu] {
        let mut spec = small_run(40);
        spec.generator.shape_mut().ffn = ffn;
        let off = furthest(&losses(&spec, &gpu()), &losses(&spec, &Device::flex()));
        assert!(off < SINGLE, "{ffn:?}: off by {off:.1e}");
    }
}

#[test]
fn models_train_in_half_precision_where_the_device_has_it() {
    let types = [(Precision::F16, FloatDType::F16), (Precision::Bf16, FloatDType::BF16)];
    for (precision, dtype) in types {
        if !gpu().supports_dtype(dtype) {
            println!("SKIPPED: the device does not compute in {}", precision.name());
            continue;
        }
        let spec = RunSpec { precision, ..small_run(40) };
        let single = losses(&small_run(40), &Device::flex());
        let half = losses(&spec, &gpu());
        let off = furthest(&half, &single);
        assert!(off < 1e-2 && half != single, "{precision:?}: off by {off:.1e}");
    }
}

#[test]
fn tokenizers_train_as_on_the_processor() {
    let options = ProceduralOptions { seed: 5, train_clips: 8, val_clips: 2, test_clips: 2 };
    let source = Procedural::new(options);
    let spec = TokenizerSection {
        width: Some(8),
        depth: Some(1),
        steps: Some(8),
        batch: Some(4),
        window: Some(40),
        ..Default::default()
    }
    .spec(QuantizerSpec::default(), &TextSpec::default());
    let losses = |device: &Device| {
        let mut losses = Vec::new();
        let mut note = |Step { loss, .. }: Step| {
            losses.push(loss);
            ControlFlow::Continue(())
        };
        tokenizer::train(&spec, &tokenizer::Corpus::wordless(&source), device, None, &mut note)
            .expect("an ordinary training");
        losses
    };
    let off = furthest(&losses(&gpu()), &losses(&Device::flex()));
    assert!(off < 10.0 * SINGLE, "off by {off:.1e}");
}
