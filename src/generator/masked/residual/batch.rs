//! [`LayerBatch`]: clips packed row after row, each asked for the codes of one layer.

use std::ops::Range;
use std::sync::Arc;

use crate::codes::Grid;
use crate::generator::stack::{Supervised, n_supervised};
use crate::ops::SequenceLayout;

/// A clip that is asked for the codes of a layer.
#[derive(Clone, Debug)]
pub struct Asked<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The codes of the layers before, layer after layer, each from 0: `[layer, n_places]`.
    pub below: &'a [u32],
    /// The layer that is asked for, counted from 0; at least 1.
    pub layer: usize,
    /// The places that are supervised.
    pub places: Range<usize>,
    /// The layer's codes at these places.
    pub targets: &'a [u32],
}

impl<'a> Asked<'a> {
    /// A clip with codes of `n_layers` layers, of which one is asked for at some places.
    pub fn of_clip(
        text: &'a [f32],
        codes: &'a [u32],
        n_layers: usize,
        layer: usize,
        places: Range<usize>,
    ) -> Self {
        let (below, rest) = codes.split_at(codes.len() / n_layers * layer);
        Self { text, below, layer, targets: &rest[places.clone()], places }
    }

    /// Places of the clip.
    pub fn n_places(&self) -> usize {
        self.below.len() / self.layer
    }
}

/// A batch as the second stage takes it.
#[derive(Clone, Debug)]
pub struct LayerBatch {
    pub layout: Arc<SequenceLayout>,
    /// `[n_text_rows, d_text]`, all prefixes after one another.
    pub text: Vec<f32>,
    /// The row of the embedding that each layer adds to each place, layer after layer,
    /// `[layers, n_place_rows]`; the row after the last where the layer is not shown.
    pub shown: Arc<[u32]>,
    /// The layer that is asked for at each place, from 0 for the second: `[n_place_rows]`.
    pub layers: Arc<[u32]>,
    /// For each row of the batch, where it comes from: a text row, or `n_text_rows` + a place.
    pub order: Arc<[u32]>,
    /// What is supervised of each layer after the first.
    pub targets: Vec<Supervised>,
    /// Places of each clip.
    pub n_places: Vec<usize>,
}

impl LayerBatch {
    /// Packs clips.
    pub fn pack(clips: &[Asked], grid: &Grid, d_text: usize) -> Self {
        let n_text_rows: usize = clips.iter().map(|clip| clip.text.len() / d_text).sum();
        let (mut order, mut lengths, mut layers) = (Vec::new(), Vec::new(), Vec::new());
        let mut targets = vec![<(Vec<u32>, Vec<u32>)>::default(); grid.scales.len() - 1];
        let (mut next_text, mut next_place) = (0, n_text_rows);
        for clip in clips {
            let (n_text, n_places) = (clip.text.len() / d_text, clip.n_places());
            let first = order.len() + n_text;
            order.extend((next_text..next_text + n_text).map(|row| row as u32));
            order.extend((next_place..next_place + n_places).map(|row| row as u32));
            layers.extend(std::iter::repeat_n(clip.layer as u32 - 1, n_places));
            let (rows, codes) = &mut targets[clip.layer - 1];
            rows.extend(clip.places.clone().map(|place| (first + place) as u32));
            codes.extend(clip.targets);
            (next_text, next_place) = (next_text + n_text, next_place + n_places);
            lengths.push(n_text + n_places);
        }
        Self {
            layout: Arc::new(SequenceLayout::new(&lengths, &lengths).expect("clips have text")),
            text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
            shown: shown(clips, grid),
            layers: layers.into(),
            order: order.into(),
            targets: targets.into_iter().map(Supervised::from).collect(),
            n_places: clips.iter().map(Asked::n_places).collect(),
        }
    }

    /// Supervised codes.
    pub fn n_targets(&self) -> usize {
        n_supervised(&self.targets)
    }
}

/// Rows of the embedding that the layers add to the places of all clips, as far as one is shown.
fn shown(clips: &[Asked], grid: &Grid) -> Arc<[u32]> {
    let nothing = rows_of_embedding(grid) as u32;
    let most = clips.iter().map(|clip| clip.layer).max().unwrap_or(0);
    let layers = grid.offsets().take(most).enumerate();
    let rows = layers.flat_map(|(layer, offset)| {
        clips.iter().flat_map(move |clip| {
            let n = clip.n_places();
            let code = move |place| match layer < clip.layer {
                true => offset as u32 + clip.below[layer * n + place],
                false => nothing,
            };
            (0..n).map(code)
        })
    });
    rows.collect()
}

/// Rows of the embedding: the codes of all layers but the last.
pub fn rows_of_embedding(grid: &Grid) -> usize {
    grid.scales[..grid.scales.len() - 1].iter().map(|scale| scale.n_vocab).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::{Length, Scale};

    #[test]
    fn a_clip_is_shown_the_layers_before_the_one_that_is_asked_for() {
        let scale = |n_vocab| Scale { n_vocab, length: Length::FramesPerCode(4) };
        let grid = Grid { scales: vec![scale(10), scale(20), scale(30)], end_token: false };
        let one = Asked::of_clip(&[0.5; 2], &[1, 2, 3, 4, 5, 6], 3, 1, 1..2);
        let other = Asked::of_clip(&[0.5], &[7, 8, 9], 3, 2, 0..1);
        let batch = LayerBatch::pack(&[one, other], &grid, 1);
        // Two places of one clip, one of the other; the first is not shown the second layer.
        assert_eq!(*batch.shown, [1, 2, 7, 30, 30, 10 + 8]);
        assert_eq!(*batch.layers, [0, 0, 1]);
        assert_eq!(*batch.order, [0, 1, 3, 4, 2, 5]);
        assert_eq!((&*batch.targets[0].rows, &*batch.targets[0].codes), (&[3][..], &[4][..]));
        assert_eq!((&*batch.targets[1].rows, &*batch.targets[1].codes), (&[5][..], &[9][..]));
        assert_eq!((batch.n_targets(), &batch.n_places[..]), (2, &[2, 1][..]));
    }
}
