//! [`Piece`]: frames of a clip that a tokenizer reads at once, and the latents that it makes of them.

use super::architecture::ArchitectureSpec;
use super::transformer::TransformerSpec;

/// Frames that are read at once, and the latents that equal spans of them have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    pub n_frames: usize,
    pub n_latents: usize,
}

impl Piece {
    /// The middle of a latent's span, in frames from the start of the piece.
    pub fn middle(&self, latent: usize) -> f64 {
        (latent as f64 + 0.5) * (self.n_frames as f64 / self.n_latents as f64)
    }

    /// The latent whose span has the middle of a frame.
    pub fn latent_of(&self, frame: usize) -> usize {
        (2 * frame + 1) * self.n_latents / (2 * self.n_frames)
    }
}

impl TransformerSpec {
    /// As few pieces of a clip as have `span` frames or fewer each, as equal as may be, of whole strides. Frames after the
    /// last whole stride are left out.
    pub fn pieces(&self, n_frames: usize) -> Vec<Piece> {
        let n = n_frames / self.frames;
        let count = n.div_ceil(self.span / self.frames);
        let piece = |i: usize| {
            let strides = n * (i + 1) / count - n * i / count;
            let n_latents = self.latents.unwrap_or(strides);
            Piece { n_frames: strides * self.frames, n_latents }
        };
        (0..count).map(piece).collect()
    }
}

impl ArchitectureSpec {
    /// The pieces of a clip; none if it is shorter than a stride.
    pub fn pieces(&self, n_frames: usize) -> Vec<Piece> {
        if let Self::Transformer(sizes) = self {
            return sizes.pieces(n_frames);
        }
        let n_latents = n_frames / self.stride();
        let whole = Piece { n_frames: n_latents * self.stride(), n_latents };
        if n_latents == 0 { Vec::new() } else { vec![whole] }
    }

    /// The latents of a clip of so many frames.
    pub fn n_latents(&self, n_frames: usize) -> usize {
        self.pieces(n_frames).iter().map(|piece| piece.n_latents).sum()
    }

    /// The middle of each latent's span, in frames from the start of a clip.
    pub fn middles(&self, n_frames: usize) -> Vec<f64> {
        let (mut middles, mut start) = (Vec::new(), 0.0);
        for piece in self.pieces(n_frames) {
            middles.extend((0..piece.n_latents).map(|latent| start + piece.middle(latent)));
            start += piece.n_frames as f64;
        }
        middles
    }

    /// For each frame of a clip in whole strides, the latent whose span has its middle.
    pub fn latents_of_frames(&self, n_frames: usize) -> Vec<usize> {
        let (mut latents, mut first) = (Vec::new(), 0);
        for piece in self.pieces(n_frames) {
            latents.extend((0..piece.n_frames).map(|frame| first + piece.latent_of(frame)));
            first += piece.n_latents;
        }
        latents
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transformer(latents: Option<usize>) -> ArchitectureSpec {
        ArchitectureSpec::Transformer(TransformerSpec { latents, span: 64, ..Default::default() })
    }

    fn sizes(spec: &ArchitectureSpec, n_frames: usize) -> Vec<[usize; 2]> {
        let pieces = spec.pieces(n_frames).into_iter();
        pieces.map(|piece| [piece.n_frames, piece.n_latents]).collect()
    }

    #[test]
    fn long_clips_are_parted_evenly() {
        let free = transformer(None);
        assert_eq!(sizes(&free, 64), [[64, 16]]);
        assert_eq!(sizes(&free, 68), [[32, 8], [36, 9]]);
        assert_eq!(sizes(&free, 196), [[48, 12], [48, 12], [48, 12], [52, 13]]);
        assert_eq!(sizes(&free, 15), [[12, 3]]);
        assert!(sizes(&free, 3).is_empty());
    }

    #[test]
    fn a_fixed_number_of_latents_is_that_of_every_piece() {
        let fixed = transformer(Some(25));
        for n_frames in [4, 8, 40, 64, 67] {
            assert_eq!(fixed.n_latents(n_frames), 25, "{n_frames} frames");
        }
        assert_eq!((fixed.n_latents(3), fixed.n_latents(68)), (0, 50));
        assert_eq!(sizes(&fixed, 70), [[32, 25], [36, 25]]);
    }

    #[test]
    fn every_kind_has_latents_of_whole_strides() {
        let kinds = [ArchitectureSpec::default(), transformer(None)];
        for kind in kinds {
            let latents: Vec<usize> = (0..72).map(|frame| frame / 4).collect();
            assert_eq!(kind.latents_of_frames(75), latents);
            let middles: Vec<f64> = (0..18).map(|latent| 4.0 * f64::from(latent) + 2.0).collect();
            assert_eq!((kind.middles(75), kind.n_latents(75)), (middles, 18));
        }
    }

    #[test]
    fn spans_of_a_fixed_number_are_equal() {
        let fixed = transformer(Some(5));
        assert_eq!(fixed.middles(8), [0.8, 2.4000000000000004, 4.0, 5.6000000000000005, 7.2]);
        assert_eq!(fixed.latents_of_frames(8), [0, 0, 1, 2, 2, 3, 4, 4]);
        // More latents than frames: some have the middle of none.
        assert_eq!(fixed.latents_of_frames(4), [0, 1, 3, 4]);
        assert_eq!(fixed.latents_of_frames(68)[30..34], [4, 4, 5, 5]);
    }
}
