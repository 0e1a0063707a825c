//! [`TokenStream`]: which targets each step supervises, as a pure function of seed and step.

use std::borrow::Cow;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::autoregressive::{Batch, Sequence, end_token};
use crate::learn::params::below;
use crate::text::TextStore;

/// The shuffle of an epoch takes its ChaCha stream from here on, one stream an epoch.
const FIRST_EPOCH_STREAM: u64 = 1 << 32;

/// The training split as an endless stream of supervised tokens, reshuffled each epoch.
///
/// A step takes the next `batch_tokens` of them. A clip that straddles two steps stands in both,
/// each time with its own part supervised, so that every step has the same number of targets and
/// every target is met once an epoch. Codes of several scales follow one another, scale after scale.
pub struct TokenStream<'a> {
    tokens: &'a TokenStore,
    text: &'a TextStore,
    seed: u64,
    /// Supervised tokens of an epoch: codes, and an end token a clip where there is one.
    epoch_tokens: usize,
    epoch: Option<Epoch>,
}

/// A clip of a batch, with its codes as ids of one vocabulary.
struct Part<'a> {
    text: &'a [f32],
    codes: Cow<'a, [u32]>,
    from: usize,
    to: usize,
}

impl Part<'_> {
    fn sequence(&self) -> Sequence<'_> {
        let &Self { text, ref codes, from, to } = self;
        Sequence { text, codes, from, to }
    }
}

/// The clips of one epoch in their order, each with the caption that it shows.
struct Epoch {
    index: usize,
    clips: Vec<(usize, u32)>,
    /// Where each clip's targets start, and the end.
    starts: Vec<usize>,
}

impl<'a> TokenStream<'a> {
    /// The stream that `seed` gives over the training split.
    pub fn new(tokens: &'a TokenStore, text: &'a TextStore, seed: u64) -> Self {
        let epoch_tokens = tokens.n_targets(Split::Train);
        Self { tokens, text, seed, epoch_tokens, epoch: None }
    }

    /// Supervised tokens of the training split.
    pub fn epoch_tokens(&self) -> usize {
        self.epoch_tokens
    }

    /// The batch of `n` targets that starts at target `position` of the stream.
    pub fn batch(&mut self, position: usize, n: usize) -> Batch {
        let mut parts = Vec::new();
        let (mut at, end) = (position, position + n);
        while at < end {
            let part = self.part(at, end - at);
            at += part.to - part.from;
            parts.push(part);
        }
        let sequences: Vec<Sequence> = parts.iter().map(Part::sequence).collect();
        Batch::pack(&sequences, self.text.dim(), end_token(self.tokens.n_vocab()))
    }

    /// The clip at `position` with at most `limit` targets supervised.
    fn part(&mut self, position: usize, limit: usize) -> Part<'a> {
        let (index, within) = (position / self.epoch_tokens, position % self.epoch_tokens);
        let (tokens, text) = (self.tokens, self.text);
        let epoch = self.epoch(index);
        let place = epoch.starts.partition_point(|start| *start <= within) - 1;
        let from = within - epoch.starts[place];
        let taken = (epoch.starts[place + 1] - within).min(limit);
        let (clip, caption) = epoch.clips[place];
        let codes = tokens.stream(Split::Train, clip);
        Part { text: text.embedding(caption), codes, from, to: from + taken }
    }

    fn epoch(&mut self, index: usize) -> &Epoch {
        if self.epoch.as_ref().is_none_or(|epoch| epoch.index != index) {
            self.epoch = Some(self.shuffle(index));
        }
        self.epoch.as_ref().expect("just set")
    }

    /// Fisher and Yates, then a caption for each clip, all from the epoch's own stream.
    fn shuffle(&self, index: usize) -> Epoch {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(FIRST_EPOCH_STREAM + index as u64);
        let mut order: Vec<usize> = (0..self.tokens.n_clips(Split::Train)).collect();
        for i in (1..order.len()).rev() {
            order.swap(i, below(&mut rng, i + 1));
        }
        let caption = |clip: usize| {
            let captions = self.text.captions(Split::Train, clip);
            (clip, captions[below(&mut rng, captions.len())])
        };
        let clips: Vec<(usize, u32)> = order.into_iter().map(caption).collect();
        let mut starts = vec![0];
        for (clip, _) in &clips {
            let targets = self.tokens.n_targets_of_clip(Split::Train, *clip);
            starts.push(starts[starts.len() - 1] + targets);
        }
        Epoch { index, clips, starts }
    }
}
