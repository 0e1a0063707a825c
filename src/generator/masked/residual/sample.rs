//! Motions from the second stage: a layer at a time, its codes all at once.

use std::slice;

use super::batch::{Asked, LayerBatch};
use super::model::ResidualModel;
use crate::codes::Grid;
use crate::generator::Sampling;
use crate::generator::masked::making::{Making, guided};

/// The codes of the layers after the first join motions that have those of the first; `no_text` is the
/// text of a caption that is left out, `[d_text]`.
pub fn draw_layers(
    model: &ResidualModel,
    grid: &Grid,
    making: &mut [Making],
    no_text: &[f32],
    sampling: &Sampling,
) {
    for layer in 1..grid.scales.len() {
        let pass = |text| logits(model, grid, making, layer, text, no_text.len());
        let mut rows = guided(pass, no_text, sampling.guidance).into_iter();
        let all = 0..grid.scales[layer].n_vocab;
        for motion in &mut *making {
            for kept in motion.kept(layer) {
                let row = rows.next().expect("a row a place");
                let draw = |rng: &mut _| sampling.draw.code(&row, slice::from_ref(&all), rng);
                let code = kept.unwrap_or_else(|| draw(&mut motion.rng) as u32);
                motion.codes.push(code);
            }
        }
    }
}

/// Logits of the codes of a layer, a row a place of all motions; with their texts, or all with one.
fn logits(
    model: &ResidualModel,
    grid: &Grid,
    making: &[Making],
    layer: usize,
    text: Option<&[f32]>,
    d_text: usize,
) -> Vec<Vec<f32>> {
    let most = making.iter().map(|motion| motion.n_places).max().unwrap_or(0);
    let unknown = vec![0; most];
    let asked = making.iter().map(|motion| Asked {
        text: text.unwrap_or(motion.text),
        below: &motion.codes,
        layer,
        places: 0..motion.n_places,
        targets: &unknown[..motion.n_places],
    });
    let asked: Vec<Asked> = asked.collect();
    let logits = model.logits(&LayerBatch::pack(&asked, grid, d_text), layer);
    let [_, columns] = logits.dims();
    let values: Vec<f32> = logits.into_data().try_into_vec().expect("logits are f32");
    values.chunks_exact(columns).map(<[f32]>::to_vec).collect()
}
