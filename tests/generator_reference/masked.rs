//! The masked transformer, and its rounds.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;

use super::reference::{Reference, gradients};
use super::{close, concat, read};
use crate::corpus::small_run;
use crate::no_scales::NoScales;
use isoflop::generator::autoregressive;
use isoflop::generator::masked::{Hidden, pack};
use isoflop::generator::{self, Draw, Network, Prompt, Sampling};
use isoflop::learn::weights::HostTensor;
use isoflop::ops::Kernels;
use isoflop::spec::RunSpec;
use isoflop::spec::{GeneratorSpec, MaskedSpec, ModelShape};

#[derive(Deserialize)]
struct MaskedNotes {
    shape: ModelShape,
    n_vocab: usize,
    clips: Vec<HiddenClip>,
    made: Vec<Made>,
    loss: f64,
}

#[derive(Deserialize)]
struct HiddenClip {
    codes: Vec<u32>,
    hidden: Vec<usize>,
}

/// The codes of motions of the likeliest codes, by so many rounds.
#[derive(Deserialize)]
struct Made {
    rounds: usize,
    guidance: f64,
    codes: Vec<Vec<u32>>,
}

/// The masked model of the reference.
fn masked_of(
    reference: &Reference<MaskedNotes>,
    kernels: Kernels,
    device: &Device,
) -> autoregressive::Model {
    let MaskedNotes { shape, n_vocab, .. } = &reference.notes;
    let mut unused = ChaCha8Rng::seed_from_u64(0);
    let drawn = autoregressive::Transformer::init(shape, *n_vocab, &mut unused, device);
    autoregressive::Model::new(reference.parameters(drawn), shape, *n_vocab, kernels, device)
}

fn compare_masked(kernels: Kernels, device: &Device) {
    let reference: Reference<MaskedNotes> = read("masked");
    let MaskedNotes { shape, n_vocab, clips, loss: expected, .. } = &reference.notes;
    let texts = reference.part("text.");
    let hide = |(clip, text): (&HiddenClip, &'_ HostTensor)| {
        let shown = clip.codes.iter().enumerate();
        let is_hidden = |place| clip.hidden.contains(&place);
        let end = *n_vocab as u32;
        let shown = shown.map(|(place, &code)| if is_hidden(place) { end } else { code });
        let targets = clip.hidden.iter().map(|&place| (place, clip.codes[place]));
        (text.values.clone(), shown.collect::<Vec<_>>(), targets.collect::<Vec<_>>())
    };
    let parts: Vec<_> = clips.iter().zip(texts.values()).map(hide).collect();
    let clips = parts.iter().map(|(text, shown, targets)| Hidden {
        text,
        shown: shown.clone(),
        targets: targets.clone(),
    });
    let batch = pack(&clips.collect::<Vec<_>>(), shape.d_text);
    let model = masked_of(&reference, kernels, &device.clone().autodiff());
    let loss = model.loss(&batch);
    close(f64::from(loss.clone().into_scalar::<f32>()), *expected);
    let gradients = gradients(loss, &model.weights);
    let logits = concat([model.logits(&batch)]);
    reference.compare(&logits, &gradients, &format!("{kernels:?}, {device:?}"));
}

#[test]
fn masked_logits_and_gradients_are_those_of_the_equations() {
    compare_masked(Kernels::Own, &Device::flex());
    compare_masked(Kernels::Plain, &Device::flex());
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_the_masked_logits_and_gradients_of_the_equations() {
    compare_masked(Kernels::Plain, &Device::ndarray());
}

/// The rounds of the masked model: which codes are hidden again, and what stays.
#[test]
fn rounds_leave_the_codes_that_momasks_schedule_leaves() {
    let reference: Reference<MaskedNotes> = read("masked");
    let MaskedNotes { shape, n_vocab, made, .. } = &reference.notes;
    let mut spec: RunSpec = small_run(*n_vocab);
    let own = MaskedSpec { shape: shape.clone(), corruption: 0.0, text_drop: 0.1 };
    spec.generator = GeneratorSpec::Masked(own);
    let sampler = generator::of(&spec).sampler(&spec, reference.part("param."), &Device::flex());
    let (sampler, texts) = (sampler.unwrap(), reference.part("prompt."));
    for Made { rounds, guidance, codes } in made {
        let prompts = codes.iter().zip(texts.values()).map(|(codes, text)| Prompt {
            text: &text.values,
            n_frames: Some(4 * codes.len()),
            seed: 0,
            index: 0,
            edit: None,
        });
        let prompts: Vec<Prompt> = prompts.collect();
        let draw = Draw { temperature: 0.0, ..Draw::default() };
        let sampling = Sampling { draw, guidance: *guidance, rounds: *rounds };
        let sampled = sampler.sample(&prompts, &NoScales, &sampling).unwrap();
        let found: Vec<Vec<u32>> = sampled.into_iter().map(|one| one.codes).collect();
        assert_eq!(&found, codes, "{rounds} rounds, guidance {guidance}");
    }
}
