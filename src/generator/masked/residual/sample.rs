//! Motions from the second stage: a layer at a time, its codes all at once.

use super::batch::{Asked, LayerBatch};
use super::model::ResidualModel;
use crate::codes::Grid;
use crate::generator::Sampling;
use crate::generator::sampling::{Making, guided, rows};

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
        for motion in &mut *making {
            for kept in motion.kept(motion.codes.len(), n_places(motion, layer)) {
                let row = rows.next().expect("a row a place");
                let drawn = || sampling.draw.any_code(&row, &mut motion.rng);
                motion.codes.push(kept.unwrap_or_else(drawn));
            }
        }
    }
}

/// Places of a motion that has the codes of so many layers.
fn n_places(motion: &Making, layers: usize) -> usize {
    motion.codes.len() / layers
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
    let most = making.iter().map(|motion| n_places(motion, layer)).max().unwrap_or(0);
    let unknown = vec![0; most];
    let asked = making.iter().map(|motion| Asked {
        text: text.unwrap_or(motion.text),
        below: &motion.codes,
        layer,
        places: 0..n_places(motion, layer),
        targets: &unknown[..n_places(motion, layer)],
    });
    let asked: Vec<Asked> = asked.collect();
    rows(model.logits(&LayerBatch::pack(&asked, grid, d_text), layer))
}
