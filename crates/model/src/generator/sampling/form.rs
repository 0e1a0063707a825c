//! [`StreamForm`]: which codes may follow one another in a stream of a clip's codes.

use std::ops::Range;

use crate::codes::{Grid, Length};

/// The stream of a clip, scale after scale, ids of a scale following those of the scales before it;
/// after all of them the end token.
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

/// What may come next.
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

    /// What may follow the ids so far.
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

    /// The same while the length is not known: the first scale goes on, or ends where there is no room
    /// for more on every scale. A clip has a code.
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

    /// The codes of the clip, each in its own codebook, and the frames that they stand for.
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
