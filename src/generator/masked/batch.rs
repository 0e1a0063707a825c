//! Clips with hidden codes, packed as the transformer takes them.

use std::f64::consts::FRAC_2_PI;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use crate::generator::autoregressive::{Batch, end_token};
use crate::learn::params::{below, distinct};
use crate::ops::SequenceLayout;

/// A clip of which some codes are hidden.
#[derive(Clone, Debug)]
pub struct Hidden<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The codes as they are shown; the end token's id stands for a hidden one.
    pub shown: Vec<u32>,
    /// Codes that are supervised, by place, and what they are.
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

    /// Shows a hidden code as a random one.
    pub fn corrupt(&mut self, place: usize, n_vocab: usize, rng: &mut ChaCha8Rng) {
        self.shown[place] = below(rng, n_vocab) as u32;
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
    let n_text_rows: usize = clips.iter().map(|clip| clip.text.len() / d_text).sum();
    let (mut order, mut target_rows, mut targets) = (Vec::new(), Vec::new(), Vec::new());
    let (mut lengths, mut next_text, mut next_code) = (Vec::new(), 0, n_text_rows);
    for clip in clips {
        let (n_text, n_codes) = (clip.text.len() / d_text, clip.shown.len());
        let first = order.len() + n_text;
        order.extend((next_text..next_text + n_text).map(|row| row as u32));
        order.extend((next_code..next_code + n_codes).map(|row| row as u32));
        target_rows.extend(clip.targets.iter().map(|(place, _)| (first + place) as u32));
        targets.extend(clip.targets.iter().map(|(_, code)| *code));
        (next_text, next_code) = (next_text + n_text, next_code + n_codes);
        lengths.push(n_text + n_codes);
    }
    let layout = SequenceLayout::new(&lengths, &lengths).expect("clips have text");
    Batch {
        layout: Arc::new(layout),
        text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
        codes: clips.iter().flat_map(|clip| &clip.shown).copied().collect(),
        order: order.into(),
        target_rows: target_rows.into(),
        targets: targets.into(),
    }
}
