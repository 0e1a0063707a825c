//! [`Hidden`]: clips with hidden codes, as the transformer takes them, as training shows them, and as their
//! loss is measured.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::residual::Asked;
use crate::data::Split;
use crate::draws::{below, distinct, unit};
use crate::generator::Inputs;
use crate::generator::autoregressive::{Batch, Model, Part, end_token};
use crate::generator::losses::{SplitSums, passes};
use crate::generator::stack::packed;
use crate::ops::SequenceLayout;
use crate::progress::moved;
use crate::spec::flops::exact_whole;
use crate::spec::{GeneratorSpec, MaskedSpec, ModelShape, RunSpec};

/// A clip of which some codes are hidden.
#[derive(Clone, Debug)]
pub struct Hidden<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The visible codes; the end token's id stands for a hidden one.
    pub shown: Vec<u32>,
    /// Positions and values of the supervised codes.
    pub targets: Vec<(usize, u32)>,
}

impl<'a> Hidden<'a> {
    /// A clip of which so many codes, drawn at random, are hidden and supervised.
    pub fn some(
        text: &'a [f32],
        codes: &[u32],
        n_hidden: usize,
        n_vocab: usize,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let mut places = distinct(codes.len(), n_hidden, rng);
        places.sort_unstable();
        let mut shown = codes.to_vec();
        places.iter().for_each(|&place| shown[place] = end_token(n_vocab));
        let targets = places.into_iter().map(|place| (place, codes[place])).collect();
        Self { text, shown, targets }
    }
}

/// A clip of which as many codes are hidden as in the mean of training: the mean of cos(π u / 2).
pub fn hidden_clip<'a>(text: &'a [f32], codes: &[u32], n_vocab: usize) -> Hidden<'a> {
    let n_hidden = (FRAC_2_PI * codes.len() as f64).ceil() as usize;
    let mut shown = codes.to_vec();
    shown[..n_hidden].fill(end_token(n_vocab));
    Hidden { text, shown, targets: codes[..n_hidden].iter().copied().enumerate().collect() }
}

/// Packs clips; every position of `[text | codes]` sees every other.
pub fn pack(clips: &[Hidden], d_text: usize) -> Batch {
    let size = |clip: &Hidden| [clip.text.len() / d_text, clip.shown.len()];
    let sizes: Vec<[usize; 2]> = clips.iter().map(size).collect();
    let (mut target_rows, mut targets, mut start) = (Vec::new(), Vec::new(), 0);
    for (clip, [n_text, n_codes]) in clips.iter().zip(&sizes) {
        target_rows.extend(clip.targets.iter().map(|(place, _)| (start + n_text + place) as u32));
        targets.extend(clip.targets.iter().map(|(_, code)| *code));
        start += n_text + n_codes;
    }
    let (order, lengths) = packed(&sizes);
    Batch {
        layout: Arc::new(SequenceLayout::new(&lengths, &lengths).expect("clips have text")),
        text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
        codes: clips.iter().flat_map(|clip| &clip.shown).copied().collect(),
        order,
        target_rows: target_rows.into(),
        targets: targets.into(),
    }
}

/// Multiply-adds of a batch of clips, times two: each clip at its own length, the head per target.
pub fn forward_flops(shape: &ModelShape, n_vocab: usize, clips: &[Hidden], batch: &Batch) -> f64 {
    let blocks = clips.iter().enumerate().map(|(i, clip)| {
        let n = clip.shown.len();
        exact_whole(shape, n_vocab, batch.layout.len(i) - n, n, 0)
    });
    let heads = 2.0 * (batch.targets.len() * shape.d_model * (n_vocab + 1)) as f64;
    blocks.sum::<f64>() + heads
}

// [`Shown`]: clips as training shows them to either stage.

/// The training clips of a run.
pub struct Shown<'a> {
    spec: &'a RunSpec,
    inputs: &'a Inputs<'a>,
    /// The text of a caption that is left out.
    no_text: Vec<f32>,
}

impl<'a> Shown<'a> {
    /// The codes for training a run.
    pub fn new(spec: &'a RunSpec, inputs: &'a Inputs<'a>) -> Self {
        Self { spec, inputs, no_text: vec![0.0; spec.shape().d_text] }
    }

    /// A clip for the first stage: codes of the whole clip are hidden; those in the current part are supervised, at least
    /// one.
    pub fn hidden(&self, part: &Part, rng: &mut ChaCha8Rng) -> Hidden<'_> {
        let (own, n_vocab) = (own(self.spec), self.spec.codes.scales[0].n_vocab);
        let codes = self.inputs.tokens.scale(Split::Train, part.clip, 0);
        let text = self.text(part, rng);
        let share = (FRAC_PI_2 * unit(rng)).cos();
        let n_hidden = ((share * codes.len() as f64).round() as usize).clamp(1, codes.len());
        let mut clip = Hidden::some(text, codes, n_hidden, n_vocab, rng);
        clip.targets.retain(|(place, _)| part.targets.contains(place));
        if clip.targets.is_empty() {
            let place = part.targets.start;
            clip.shown[place] = n_vocab as u32;
            clip.targets.push((place, codes[place]));
        }
        for (place, _) in clip.targets.clone() {
            if unit(rng) < own.corruption {
                clip.shown[place] = below(rng, n_vocab) as u32;
            }
        }
        clip
    }

    /// A clip for the second stage, which is asked for a layer drawn as MoMask draws it.
    pub fn asked(&self, part: &Part, rng: &mut ChaCha8Rng) -> Asked<'_> {
        let codes = self.inputs.tokens.clip(Split::Train, part.clip);
        let text = self.text(part, rng);
        let layer = drawn_layer(self.spec.codes.scales.len(), unit(rng));
        Asked::of_clip(text, codes, self.spec.codes.scales.len(), layer, part.targets.clone())
    }

    /// A clip's caption, or none.
    fn text(&self, part: &Part, rng: &mut ChaCha8Rng) -> &[f32] {
        let text = self.inputs.text.embedding(part.caption);
        if unit(rng) < own(self.spec).text_drop { &self.no_text } else { text }
    }
}

/// The description of a run's generator, which is of this kind.
pub fn own(spec: &RunSpec) -> &MaskedSpec {
    match &spec.generator {
        GeneratorSpec::Masked(own) => own,
        other => unreachable!("a {} generator", other.name()),
    }
}

/// The layer that `u`, drawn evenly from 0 to 1, asks for, of `n_layers` counted from 0: 1 + (K − 2)
/// (1 − cos(π u / 2)), rounded. The first layers come more often, as in MoMask.
pub fn drawn_layer(n_layers: usize, u: f64) -> usize {
    let height = 1.0 - (FRAC_PI_2 * u).cos();
    1 + (height * (n_layers - 2) as f64).round() as usize
}

// A bound on the loss of the first scale on a split.
//
// A masked model gives no likelihood, but a bound on it: codes in any order, each from those before it
// in that order (Uria et al. 2014; Hoogeboom et al. 2022, "Autoregressive Diffusion Models"). With
// m hidden codes of n, m drawn evenly from 1 to n and the hidden ones at random, the mean over them of
// −ln p is a bound on the nats of a code. Each clip is measured at [`MASKS`] values of m, spread evenly.

/// Number of masks per clip.
const MASKS: usize = 4;

/// Seed of the masks, the same for every model.
const SEED: u64 = 0;

/// Adds a model's loss on the codes of the first scale, each clip with one of its captions.
pub fn bound(model: &Model, inputs: &Inputs, sums: &mut SplitSums) {
    let (tokens, split) = (inputs.tokens, sums.split);
    let n_vocab = tokens.grid().scales[0].n_vocab;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for clips in passes(tokens, split) {
        for mask in 0..MASKS {
            let hidden = clips.clone().map(|clip| {
                let text = inputs.text.shown(split, clip);
                let codes = tokens.scale(split, clip, 0);
                let n_hidden = spread(codes.len(), mask, clip);
                Hidden::some(text, codes, n_hidden, n_vocab, &mut rng)
            });
            let hidden: Vec<Hidden> = hidden.collect();
            let batch = pack(&hidden, inputs.text.dim());
            let losses = model.nll(&batch);
            sums.count(0, &losses.likeliest);
            let mut own = losses.nats.into_iter();
            for (clip, hidden) in clips.clone().zip(&hidden) {
                // The mean over hidden codes is used for every code of the clip.
                let n_hidden = hidden.targets.len();
                let weight = hidden.shown.len() as f64 / (MASKS * n_hidden) as f64;
                sums.add_nats(clip, weight * own.by_ref().take(n_hidden).sum::<f64>());
            }
            moved();
        }
        clips.for_each(|clip| sums.add_unigrams(clip));
    }
}

/// The number of hidden codes out of `n`: over all masks and clips, uniform from 1 to n.
fn spread(n: usize, mask: usize, clip: usize) -> usize {
    // Clips are shifted against one another by the golden section, which fills a span evenly.
    let shift = (clip as f64 * 0.618_033_988_749_895).fract();
    let share = (mask as f64 + shift) / MASKS as f64;
    1 + (share * n as f64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of six layers: acos(1 − (i + ½) / 4) of a quarter turn each.
    #[test]
    fn the_first_layers_are_asked_for_more_often() {
        let mut shares = [0.0f64; 6];
        (0..100_000).for_each(|i| shares[drawn_layer(6, (f64::from(i) + 0.5) / 1e5)] += 1e-5);
        let expected = [0.0, 0.3217, 0.2485, 0.1851, 0.1649, 0.0798];
        assert!(shares.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{shares:?}");
        assert!([0.0, 0.5, 0.999_999].map(|u| drawn_layer(2, u)) == [1; 3]);
    }
}
