//! [`Grid`]: the codes between a tokenizer and a generator.

use serde::{Deserialize, Serialize};

/// The codes that a tokenizer gives a clip: one or more scales, and whether an end token follows.
///
/// Codes of a clip stand scale after scale. ScaMo's stream is one scale with an end token; residual
/// codes are several scales of one length; multi-scale codes are several scales of fixed lengths.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Grid {
    /// At least one.
    pub scales: Vec<Scale>,
    /// Whether a clip ends with an end token, which a generator predicts after its last code.
    pub end_token: bool,
}

/// Codes of one codebook.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Scale {
    /// Codes of the codebook, without special tokens (V).
    pub n_vocab: usize,
    pub length: Length,
}

/// How many codes a clip has on a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Length {
    /// One for so many frames; frames that are left over are not encoded.
    FramesPerCode(usize),
    /// So many, however long the clip is.
    Codes(usize),
}

impl Grid {
    /// One scale with an end token.
    pub fn stream(n_vocab: usize, frames_per_code: usize) -> Self {
        let length = Length::FramesPerCode(frames_per_code);
        Self { scales: vec![Scale { n_vocab, length }], end_token: true }
    }

    /// V, the codes of all codebooks together.
    pub fn n_vocab(&self) -> usize {
        self.scales.iter().map(|scale| scale.n_vocab).sum()
    }

    /// The codes of the codebooks before each scale's own: what an id of a scale is moved by where all
    /// codebooks stand in one vocabulary.
    pub fn offsets(&self) -> impl Iterator<Item = usize> {
        self.scales.iter().scan(0, |before, scale| {
            let own = *before;
            *before += scale.n_vocab;
            Some(own)
        })
    }

    /// The codes of each scale of a clip of so many frames.
    pub fn lengths(&self, n_frames: usize) -> impl Iterator<Item = usize> {
        self.scales.iter().map(move |scale| scale.length.codes(n_frames))
    }

    /// The codes of a clip of so many frames.
    pub fn n_codes(&self, n_frames: usize) -> usize {
        self.lengths(n_frames).sum()
    }

    /// What a generator predicts of a clip of so many frames: its codes and the end token.
    pub fn n_targets(&self, n_frames: usize) -> usize {
        self.n_codes(n_frames) + usize::from(self.end_token)
    }

    /// The frames that so many codes of the first scale stand for; `None` where that depends on the clip.
    pub fn frames_of(&self, n_first: usize) -> Option<usize> {
        match self.scales.first()?.length {
            Length::FramesPerCode(frames) => Some(frames * n_first),
            Length::Codes(_) => None,
        }
    }

    /// The frames that a code stands for, over all scales; `None` where that depends on the clip.
    pub fn frames_per_code(&self) -> Option<f64> {
        let per_frame = self.scales.iter().map(|scale| match scale.length {
            Length::FramesPerCode(frames) => Some(1.0 / frames as f64),
            Length::Codes(_) => None,
        });
        Some(1.0 / per_frame.sum::<Option<f64>>()?)
    }
}

impl Length {
    fn codes(self, n_frames: usize) -> usize {
        match self {
            Self::FramesPerCode(frames) => n_frames / frames,
            Self::Codes(codes) => codes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scales(scales: &[(usize, Length)], end_token: bool) -> Grid {
        let scales = scales.iter().map(|&(n_vocab, length)| Scale { n_vocab, length }).collect();
        Grid { scales, end_token }
    }

    #[test]
    fn a_stream_has_a_code_for_four_frames_and_an_end_token() {
        let stream = Grid::stream(240, 4);
        assert_eq!((stream.n_codes(199), stream.n_targets(199)), (49, 50));
        assert_eq!((stream.n_vocab(), stream.frames_per_code()), (240, Some(4.0)));
    }

    #[test]
    fn residual_scales_have_one_length_and_multiple_scales_their_own() {
        let residual = scales(&[(512, Length::FramesPerCode(4)); 6], false);
        assert_eq!((residual.n_codes(196), residual.n_targets(196)), (294, 294));
        assert_eq!((residual.n_vocab(), residual.frames_per_code()), (3072, Some(4.0 / 6.0)));
        let full = [3, 6, 10, 15, 20, 25, 30, 36, 42, 49].map(|codes| (256, Length::Codes(codes)));
        let multiple = scales(&full, false);
        assert_eq!([40, 196].map(|frames| multiple.n_codes(frames)), [236, 236]);
        assert_eq!(multiple.frames_per_code(), None);
        assert_eq!(multiple.offsets().collect::<Vec<_>>()[..3], [0, 256, 512]);
    }
}
