//! The scale-by-scale transformer.

use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Deserialize;

use super::reference::{Reference, gradients};
use super::{close, concat, read};
use isoflop::codes::{Grid, Length, Scale};
use isoflop::generator::Network;
use isoflop::generator::scalewise;
use isoflop::learn::weights::HostTensor;
use isoflop::spec::{ModelShape, Precision, ScalewiseSpec};

#[derive(Deserialize)]
struct ScalewiseNotes {
    shape: ModelShape,
    scales: Vec<(usize, usize)>,
    d_latent: usize,
    most_latents: usize,
    clips: Vec<ScalewiseClip>,
    loss: f64,
}

#[derive(Deserialize)]
struct ScalewiseClip {
    codes: Vec<u32>,
    n_latents: usize,
    from: usize,
    to: usize,
}

/// The scale-by-scale model of the reference, and its batch.
fn scalewise_of(
    reference: &Reference<ScalewiseNotes>,
    device: &Device,
) -> (scalewise::Model, scalewise::Batch) {
    let ScalewiseNotes { shape, scales, d_latent, most_latents, clips, .. } = &reference.notes;
    let scale = |&(n_vocab, n): &(usize, usize)| Scale { n_vocab, length: Length::Codes(n) };
    let grid = Grid { scales: scales.iter().map(scale).collect(), end_token: false };
    let spec = ScalewiseSpec {
        shape: shape.clone(),
        d_latent: *d_latent,
        frames_per_latent: 4,
        most_latents: *most_latents,
        corruption: 0.5,
        text_drop: 0.1,
    };
    let mut unused = ChaCha8Rng::seed_from_u64(0);
    let mut model = scalewise::Model::init(&spec, &grid, Precision::F32, &mut unused, device);
    model.weights = reference.parameters(model.weights);
    let texts = reference.part("text.");
    let packed = clips.iter().enumerate().map(|(i, clip)| scalewise::Clip {
        text: &texts[&i.to_string()].values,
        codes: &clip.codes,
        lengths: scales.iter().map(|(_, n)| *n).collect(),
        inputs: reference.part(&format!("inputs.{i}.")).into_values().map(|x| x.values).collect(),
        length: clip.n_latents,
        supervised: clip.from..clip.to,
    });
    let clips: Vec<scalewise::Clip> = packed.collect();
    let batch = scalewise::Batch::pack(&clips, &grid, shape.d_text, model.places());
    (model, batch)
}

/// Logits of the supervised codes in the reference's order: clip after clip.
fn scalewise_logits(reference: &Reference<ScalewiseNotes>, device: &Device) -> HostTensor {
    let (model, batch) = scalewise_of(reference, device);
    let features = model.features(&batch);
    let rows = batch.targets.iter().enumerate().flat_map(|(scale, own)| {
        own.rows.iter().map(move |&row| (row as usize, scale)).collect::<Vec<_>>()
    });
    let mut rows: Vec<(usize, usize)> = rows.collect();
    rows.sort_unstable();
    let logits =
        |(row, scale): (usize, usize)| model.logits(scale, features.clone().narrow(0, row, 1));
    concat(rows.into_iter().map(logits))
}

fn compare_scalewise(device: &Device) {
    let reference = read("scalewise");
    let (model, batch) = scalewise_of(&reference, &device.clone().autodiff());
    let loss = model.loss(&batch);
    close(f64::from(loss.clone().into_scalar::<f32>()), reference.notes.loss);
    let gradients = gradients(loss, &model.weights);
    let logits = scalewise_logits(&reference, device);
    reference.compare(&logits, &gradients, &format!("{device:?}"));
}

#[test]
fn scale_by_scale_logits_and_gradients_are_those_of_the_equations() {
    compare_scalewise(&Device::flex());
}

#[test]
#[expect(deprecated, reason = "the one other backend that needs no GPU")]
fn another_backend_gives_scale_by_scale_the_logits_and_gradients_of_the_equations() {
    compare_scalewise(&Device::ndarray());
}

#[test]
fn scale_by_scale_the_likelihood_of_each_code_is_that_of_the_loss() {
    let reference = read("scalewise");
    let (model, batch) = scalewise_of(&reference, &Device::flex());
    let nll: Vec<f64> = model.nll(&batch).into_iter().flat_map(|scale| scale.nats).collect();
    let supervised = reference.notes.clips.iter().map(|clip| clip.to - clip.from);
    assert_eq!(nll.len(), supervised.sum::<usize>());
    close(nll.iter().sum::<f64>() / nll.len() as f64, reference.notes.loss);
}
