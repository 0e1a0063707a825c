//! [`TokenStream`]: which targets each step supervises, as a pure function of seed and step.

use std::ops::Range;

use crate::codes::TokenStore;
use crate::data::Split;
use crate::generator::autoregressive::{Batch, Sequence, end_token};
use crate::learn::params::{below, stream};
use crate::spec::Share;
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
    /// The clips of an epoch, by their place in the training split.
    clips: Vec<usize>,
    /// Supervised tokens of an epoch.
    epoch_tokens: usize,
    /// How much of a clip of the training split is supervised.
    n_targets: fn(&TokenStore, usize) -> usize,
    epoch: Option<Epoch>,
}

/// A clip of the stream, and which of its targets are supervised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its place in the training split.
    pub clip: usize,
    /// The caption that it shows.
    pub caption: u32,
    /// Its supervised targets or places: code i is target i, and the end token is the last.
    pub targets: Range<usize>,
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
        Self::of(tokens, text, seed, |tokens, clip| tokens.n_targets_of_clip(Split::Train, clip))
    }

    /// The same of places: the codes of the first scale, without end tokens, for models that are told
    /// how long a clip is.
    pub fn of_places(tokens: &'a TokenStore, text: &'a TextStore, seed: u64) -> Self {
        Self::of(tokens, text, seed, |tokens, clip| tokens.scale(Split::Train, clip, 0).len())
    }

    fn of(
        tokens: &'a TokenStore,
        text: &'a TextStore,
        seed: u64,
        n_targets: fn(&TokenStore, usize) -> usize,
    ) -> Self {
        let (clips, epoch_tokens, epoch) = (Vec::new(), 0, None);
        Self { tokens, text, seed, clips, epoch_tokens, n_targets, epoch }.over(Share::WHOLE)
    }

    /// The same over a share of the training split.
    pub fn over(self, share: Share) -> Self {
        let clips = self.tokens.training_clips(share);
        let epoch_tokens = clips.iter().map(|clip| (self.n_targets)(self.tokens, *clip)).sum();
        Self { clips, epoch_tokens, epoch: None, ..self }
    }

    /// Supervised tokens of an epoch.
    pub fn epoch_tokens(&self) -> usize {
        self.epoch_tokens
    }

    /// The batch of `n` targets that starts at target `position` of the stream.
    pub fn batch(&mut self, position: usize, n: usize) -> Batch {
        let (tokens, text) = (self.tokens, self.text);
        let parts = self.parts(position, n);
        let codes: Vec<_> =
            parts.iter().map(|part| tokens.stream(Split::Train, part.clip)).collect();
        let sequence = |(part, codes): (&Part, _)| Sequence {
            text: text.embedding(part.caption),
            codes,
            from: part.targets.start,
            to: part.targets.end,
        };
        let codes = codes.iter().map(|codes| &codes[..]);
        let sequences: Vec<Sequence> = parts.iter().zip(codes).map(sequence).collect();
        Batch::pack(&sequences, text.dim(), end_token(tokens.n_vocab()))
    }

    /// The `n` targets that start at target `position` of the stream.
    pub fn parts(&mut self, position: usize, n: usize) -> Vec<Part> {
        let mut parts = Vec::new();
        let (mut at, end) = (position, position + n);
        while at < end {
            let part = self.part(at, end - at);
            at += part.targets.len();
            parts.push(part);
        }
        parts
    }

    /// The clip at `position` with at most `limit` targets supervised.
    fn part(&mut self, position: usize, limit: usize) -> Part {
        let (index, within) = (position / self.epoch_tokens, position % self.epoch_tokens);
        let epoch = self.epoch(index);
        let place = epoch.starts.partition_point(|start| *start <= within) - 1;
        let from = within - epoch.starts[place];
        let taken = (epoch.starts[place + 1] - within).min(limit);
        let (clip, caption) = epoch.clips[place];
        Part { clip, caption, targets: from..from + taken }
    }

    fn epoch(&mut self, index: usize) -> &Epoch {
        if self.epoch.as_ref().is_none_or(|epoch| epoch.index != index) {
            self.epoch = Some(self.shuffle(index));
        }
        self.epoch.as_ref().expect("just set")
    }

    /// Fisher and Yates, then a caption for each clip, all from the epoch's own stream.
    fn shuffle(&self, index: usize) -> Epoch {
        let mut rng = stream(self.seed, FIRST_EPOCH_STREAM + index as u64);
        let mut order = self.clips.clone();
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
            let targets = (self.n_targets)(self.tokens, *clip);
            starts.push(starts[starts.len() - 1] + targets);
        }
        Epoch { index, clips, starts }
    }
}
