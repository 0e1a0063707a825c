//! [`Convolution`]: what a convolution over the frames of clips reads.

/// Which frames a convolution reads for each frame that it makes; what lies beyond a clip is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taps {
    /// The frame itself (kernel 1).
    Point,
    /// The frame and its neighbours at this distance (kernel 3, padding = dilation).
    Neighbours(usize),
    /// Four frames for every second one (kernel 4, stride 2, padding 1); the frames must be even.
    Halving,
    /// The frame and its neighbours after each was repeated (nearest upsampling, then kernel 3).
    Doubling,
}

impl Taps {
    /// k.
    pub fn count(self) -> usize {
        self.offsets().len()
    }

    /// Frames made of `t`.
    pub fn frames_out(self, t: usize) -> usize {
        match self {
            Taps::Point | Taps::Neighbours(_) => t,
            Taps::Halving => t / 2,
            Taps::Doubling => 2 * t,
        }
    }

    fn offsets(self) -> &'static [isize] {
        match self {
            Taps::Point => &[0],
            Taps::Neighbours(_) | Taps::Doubling => &[-1, 0, 1],
            Taps::Halving => &[-1, 0, 1, 2],
        }
    }

    /// The frames that frame `i` is made of, tap by tap, of a clip of `t` frames; `None` beyond it.
    pub fn sources(self, i: usize, t: usize) -> impl Iterator<Item = Option<usize>> {
        let (step, stride, repeat) = match self {
            Taps::Point => (1, 1, 1),
            Taps::Neighbours(dilation) => (dilation, 1, 1),
            Taps::Halving => (1, 2, 1),
            Taps::Doubling => (1, 1, 2),
        };
        self.offsets().iter().map(move |offset| {
            let place = (stride * i).checked_add_signed(offset * step as isize)?;
            (place < repeat * t).then_some(place / repeat)
        })
    }
}

/// A convolution of clips of one length, packed frame after frame, clip after clip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Convolution {
    pub n_clips: usize,
    pub taps: Taps,
    /// Whether max(x, 0) is read in place of x.
    pub rectify: bool,
}

impl Convolution {
    /// Rows made of `rows`.
    pub fn rows_out(&self, rows: usize) -> usize {
        self.n_clips * self.taps.frames_out(rows / self.n_clips)
    }

    /// For each row made, in their order, the rows of `rows` that it is made of, tap by tap.
    pub fn sources(
        &self,
        rows: usize,
    ) -> impl Iterator<Item = impl Iterator<Item = Option<usize>>> {
        let (taps, t) = (self.taps, rows / self.n_clips);
        (0..self.n_clips).flat_map(move |clip| {
            (0..taps.frames_out(t))
                .map(move |i| taps.sources(i, t).map(move |frame| Some(clip * t + frame?)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_made_of_their_neighbours_within_the_clip() {
        let sources = |taps: Taps, i| taps.sources(i, 4).collect::<Vec<_>>();
        assert_eq!(sources(Taps::Neighbours(3), 2), [None, Some(2), None]);
        assert_eq!(sources(Taps::Halving, 0), [None, Some(0), Some(1), Some(2)]);
        assert_eq!(sources(Taps::Halving, 1), [Some(1), Some(2), Some(3), None]);
        assert_eq!(sources(Taps::Doubling, 0), [None, Some(0), Some(0)]);
        assert_eq!(sources(Taps::Doubling, 7), [Some(3), Some(3), None]);
        let pair = Convolution { n_clips: 2, taps: Taps::Point, rectify: false };
        let rows: Vec<_> = pair.sources(4).flatten().collect();
        assert_eq!(rows, [0, 1, 2, 3].map(Some));
    }
}
