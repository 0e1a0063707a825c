//! Streams of codes: [`TokenStream`], which targets each step supervises, as a pure function of seed and
//! step; [`StreamForm`], which codes may follow one another in the stream of a clip that is made.

use std::ops::Range;

use super::{Batch, Sequence, end_token};
use crate::codes::{Grid, Length, TokenStore};
use crate::data::Split;
use crate::draws::{below, stream};
use crate::spec::{Share, ShownCaptions};
use crate::text::TextStore;

/// The shuffle of an epoch takes its ChaCha stream from here on, one stream an epoch.
const FIRST_EPOCH_STREAM: u64 = 1 << 32;

/// The training split as an endless stream of supervised tokens, reshuffled each epoch.
///
/// A step takes the next `batch_tokens` of them. A clip that straddles two steps is in both, each time with a different
/// part supervised, so every step has the same number of targets and every target occurs once per epoch. Codes of
/// several scales follow each other, scale by scale.
pub struct TokenStream<'a> {
    tokens: &'a TokenStore,
    text: &'a TextStore,
    seed: u64,
    /// The clips of an epoch, by their place in the training split.
    clips: Vec<usize>,
    /// Supervised tokens of an epoch.
    epoch_tokens: usize,
    /// The supervised part of a training clip.
    n_targets: fn(&TokenStore, usize) -> usize,
    captions: ShownCaptions,
    epoch: Option<Epoch>,
}

/// A clip of the stream, and which of its targets are supervised.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its index in the training split.
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
    /// The start of each clip's targets, and the end.
    starts: Vec<usize>,
}

impl<'a> TokenStream<'a> {
    /// The stream that `seed` gives over the training split.
    pub fn new(tokens: &'a TokenStore, text: &'a TextStore, seed: u64) -> Self {
        Self::of(tokens, text, seed, |tokens, clip| tokens.n_targets_of_clip(Split::Train, clip))
    }

    /// The same for positions: the codes of the first scale, without end tokens, for models that are given a clip's
    /// length.
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
        let captions = ShownCaptions::Drawn;
        Self { tokens, text, seed, clips, epoch_tokens, n_targets, captions, epoch }
            .over(Share::WHOLE)
    }

    /// The same over a share of the training split.
    pub fn over(self, share: Share) -> Self {
        let clips = self.tokens.training_clips(share);
        let epoch_tokens = clips.iter().map(|clip| (self.n_targets)(self.tokens, *clip)).sum();
        Self { clips, epoch_tokens, epoch: None, ..self }
    }

    /// The same with other captions.
    pub fn showing(self, captions: ShownCaptions) -> Self {
        Self { captions, epoch: None, ..self }
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

    /// Fisher and Yates, then a caption for each clip that is shown a drawn one, all from the epoch's own stream.
    fn shuffle(&self, index: usize) -> Epoch {
        let mut rng = stream(self.seed, FIRST_EPOCH_STREAM + index as u64);
        let mut order = self.clips.clone();
        for i in (1..order.len()).rev() {
            order.swap(i, below(&mut rng, i + 1));
        }
        let mut caption = |clip: usize| {
            let captions = self.text.captions(Split::Train, clip);
            match self.captions {
                ShownCaptions::Drawn => captions[below(&mut rng, captions.len())],
                ShownCaptions::Matched => self.text.shown_id(Split::Train, clip),
            }
        };
        let clips: Vec<(usize, u32)> =
            order.into_iter().map(|clip| (clip, caption(clip))).collect();
        let mut starts = vec![0];
        for (clip, _) in &clips {
            let targets = (self.n_targets)(self.tokens, *clip);
            starts.push(starts[starts.len() - 1] + targets);
        }
        Epoch { index, clips, starts }
    }
}

// [`StreamForm`]: a stream that grows.

/// The stream of a clip, scale by scale, with ids offset by earlier codebooks; the end token is last.
#[derive(Clone, Debug)]
pub struct StreamForm<'a> {
    grid: &'a Grid,
    /// Codes on each scale, once the clip's length is known.
    lengths: Option<Vec<usize>>,
    /// Frames, once known.
    n_frames: Option<usize>,
    /// Ids so far.
    ids: Vec<u32>,
    /// Ids at most, an end token apart.
    room: usize,
}

/// The codes allowed next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Choices {
    /// An id of these ranges.
    Ids(Vec<Range<usize>>),
    /// The clip is whole.
    Whole,
    /// The clip is not whole, and there is no room for more.
    Full,
}

impl<'a> StreamForm<'a> {
    /// A stream before its first id, of a clip of so many frames, or of any.
    pub fn new(grid: &'a Grid, n_frames: Option<usize>, room: usize) -> Self {
        let fixed = grid.scales.iter().all(|scale| matches!(scale.length, Length::Codes(_)));
        let known = n_frames.or(fixed.then_some(0));
        let lengths = known.map(|frames| grid.lengths(frames).collect());
        Self { grid, lengths, n_frames, ids: Vec::new(), room }
    }

    /// The codes allowed after the ids so far.
    pub fn choices(&self) -> Choices {
        let Some(lengths) = &self.lengths else { return self.open_choices() };
        let mut left = self.ids.len();
        for (scale, length) in lengths.iter().enumerate() {
            if left < *length {
                return self.with_room(vec![self.ids_of(scale)]);
            }
            left -= length;
        }
        Choices::Whole
    }

    /// The same while the length is unknown: the first scale continues, or ends if some scale has no room for more. A clip
    /// has at least one code.
    fn open_choices(&self) -> Choices {
        if self.ended() {
            return Choices::Whole;
        }
        let (n_scales, end) = (self.grid.scales.len(), self.grid.n_vocab());
        let next = if n_scales > 1 { self.ids_of(1) } else { end..end + 1 };
        if self.ids.is_empty() {
            self.with_room(vec![self.ids_of(0)])
        } else if n_scales > 1 && self.ids.len() == self.room / n_scales {
            Choices::Ids(vec![next])
        } else {
            self.with_room(vec![self.ids_of(0), next])
        }
    }

    fn with_room(&self, ranges: Vec<Range<usize>>) -> Choices {
        if self.ids.len() < self.room { Choices::Ids(ranges) } else { Choices::Full }
    }

    /// The stream goes on with an id that may follow.
    pub fn push(&mut self, id: usize) {
        let first_done = self.lengths.is_none() && self.grid.scales.len() > 1;
        if first_done && id >= self.grid.scales[0].n_vocab {
            let frames = self.grid.frames_of(self.ids.len()).unwrap_or(0);
            self.lengths = Some(self.grid.lengths(frames).collect());
            self.n_frames = Some(frames);
        }
        self.ids.push(id as u32);
    }

    fn ended(&self) -> bool {
        self.ids.last().is_some_and(|&id| id as usize == self.grid.n_vocab())
    }

    fn ids_of(&self, scale: usize) -> Range<usize> {
        let before = self.grid.offsets().nth(scale).expect("a scale of the grid");
        before..before + self.grid.scales[scale].n_vocab
    }

    /// The last id, if there is one.
    pub fn last(&self) -> Option<u32> {
        self.ids.last().copied()
    }

    /// The codes of the clip, each in its own codebook, and the frames that they cover.
    pub fn into_codes(self) -> (Vec<u32>, usize) {
        let n_first =
            self.ids.iter().filter(|&&id| self.ids_of(0).contains(&(id as usize))).count();
        let frames = self.n_frames.or(self.grid.frames_of(n_first)).unwrap_or(0);
        let mut codes = Vec::with_capacity(self.ids.len());
        for scale in 0..self.grid.scales.len() {
            let own = self.ids_of(scale);
            let ids = self.ids.iter().filter(|&&id| own.contains(&(id as usize)));
            codes.extend(ids.map(|&id| id - own.start as u32));
        }
        (codes, frames)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codes::Scale;

    fn only(ids: Range<usize>) -> Choices {
        Choices::Ids(vec![ids])
    }

    fn residual() -> Grid {
        let scale = |n_vocab| Scale { n_vocab, length: Length::FramesPerCode(4) };
        Grid { scales: vec![scale(3), scale(5)], end_token: false }
    }

    #[test]
    fn a_stream_without_a_length_ends_by_its_end_token_and_not_before_a_code() {
        let grid = Grid::stream(6, 4);
        let mut form = StreamForm::new(&grid, None, 9);
        assert_eq!(form.choices(), only(0..6));
        form.push(2);
        assert_eq!(form.choices(), Choices::Ids(vec![0..6, 6..7]));
        form.push(6);
        assert_eq!(form.choices(), Choices::Whole);
        assert_eq!(form.into_codes(), (vec![2], 4));
    }

    #[test]
    fn a_length_is_met_without_an_end_token() {
        let grid = Grid::stream(6, 4);
        let mut form = StreamForm::new(&grid, Some(11), 9);
        for id in [1, 5] {
            assert_eq!(form.choices(), only(0..6));
            form.push(id);
        }
        assert_eq!(form.choices(), Choices::Whole);
        assert_eq!(form.into_codes(), (vec![1, 5], 11));
    }

    #[test]
    fn the_second_scale_tells_the_length_of_the_first() {
        let grid = residual();
        let mut form = StreamForm::new(&grid, None, 9);
        form.push(2);
        form.push(0);
        assert_eq!(form.choices(), Choices::Ids(vec![0..3, 3..8]));
        form.push(7);
        assert_eq!(form.choices(), only(3..8));
        form.push(3);
        assert_eq!(form.choices(), Choices::Whole);
        assert_eq!(form.into_codes(), (vec![2, 0, 4, 0], 8));
    }

    #[test]
    fn the_first_scale_leaves_room_for_the_others() {
        let grid = residual();
        let mut form = StreamForm::new(&grid, None, 3);
        form.push(2);
        assert_eq!(form.choices(), only(3..8));
    }

    #[test]
    fn a_stream_with_no_room_left_is_full() {
        let grid = Grid::stream(6, 4);
        let mut form = StreamForm::new(&grid, None, 1);
        form.push(3);
        assert_eq!(form.choices(), Choices::Full);
        assert_eq!(form.into_codes(), (vec![3], 4));
    }
}
