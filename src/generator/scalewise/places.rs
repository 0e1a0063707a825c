//! [`Places`]: where text and codes stand in time, for the angles of attention.

use std::sync::Arc;

use crate::codes::{Grid, Length};
use crate::ops::Rope;
use crate::spec::ScalewiseSpec;

/// The span of a clip, whatever the length of a scale: codes of one time have one angle (LG-Tok).
const SPAN: f64 = 64.0;

/// The angles of text and of every slot of every scale.
///
/// The last word of a text stands at −1 and the others before it. Slot j of a scale of s codes stands at
/// the middle of what it covers, 64 (j + ½) / s, where s is the scale's length, or that of the longest
/// clip where a code stands for so many frames.
#[derive(Clone, Debug)]
pub struct Places {
    pub rope: Arc<Rope>,
    max_text: usize,
    /// The first angle of each scale.
    starts: Vec<usize>,
}

impl Places {
    /// The angles of a generator.
    pub fn new(spec: &ScalewiseSpec, codes: &Grid) -> Self {
        let shape = &spec.shape;
        let longest = spec.longest(codes);
        let max_text = shape.n_ctx - longest.iter().sum::<usize>();
        let mut positions: Vec<f64> = (0..max_text).map(|t| t as f64 - max_text as f64).collect();
        let mut starts = Vec::with_capacity(longest.len());
        for (scale, slots) in codes.scales.iter().zip(longest) {
            starts.push(positions.len());
            let across = match scale.length {
                Length::Codes(codes) => codes,
                Length::FramesPerCode(_) => slots,
            };
            positions.extend((0..slots).map(|j| SPAN * (j as f64 + 0.5) / across as f64));
        }
        let head_dim = shape.d_model / shape.n_head;
        let rope = Arc::new(Rope::at_positions(&positions, head_dim, shape.rope_base));
        Self { rope, max_text, starts }
    }

    /// The angles of a text of `n` words.
    pub fn text(&self, n: usize) -> std::ops::Range<usize> {
        self.max_text - n..self.max_text
    }

    /// The angles of the first `n` slots of a scale.
    pub fn scale(&self, scale: usize, n: usize) -> std::ops::Range<usize> {
        self.starts[scale]..self.starts[scale] + n
    }
}
