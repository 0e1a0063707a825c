//! [`Batch`]: clips packed row after row, text first, then scale after scale.

use std::ops::Range;
use std::sync::Arc;

use crate::codes::{Grid, Length};
use crate::data::Split;
use crate::generator::Inputs;
use crate::generator::stack::{Supervised, n_supervised, packed};
use crate::ops::{BlockSequence, Rope, SequenceLayout};
use crate::spec::ScalewiseSpec;

/// One clip as the model is shown it.
#[derive(Clone, Debug)]
pub struct Clip<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The targets, scale by scale, numbered from 0 in each codebook.
    pub codes: &'a [u32],
    /// Codes of each scale.
    pub lengths: Vec<usize>,
    /// The input of each scale but the first, `[s, c]` row-major.
    pub inputs: Vec<Vec<f32>>,
    /// Its length in strides of the tokenizer.
    pub length: usize,
    /// The codes that are supervised.
    pub supervised: Range<usize>,
}

impl<'a> Clip<'a> {
    /// A clip of a split, with the inputs of scales computed by `shown` from its codes and their numbers; `stride` is the
    /// tokenizer's in frames.
    pub fn of(
        (inputs, grid, stride): (&Inputs<'a>, &Grid, usize),
        (split, index): (Split, usize),
        (text, supervised): (&'a [f32], Range<usize>),
        shown: impl FnOnce(&[u32], &[usize]) -> Vec<u32>,
    ) -> Self {
        let scales = inputs.scales.expect("the job opens the tokenizer for a kind that wants it");
        let codes = inputs.tokens.clip(split, index);
        let n_frames = inputs.tokens.clip_frames(split, index);
        let (lengths, length) = (Vec::from_iter(grid.lengths(n_frames)), n_frames / stride);
        let inputs = scales.inputs(&shown(codes, &lengths), 1, n_frames);
        Self { text, codes, lengths, inputs, length, supervised }
    }

    /// Its numbers of rows: text, first scale, other scales.
    fn rows(&self, d_text: usize) -> [usize; 3] {
        let first = self.lengths[0];
        [self.text.len() / d_text, first, self.lengths.iter().sum::<usize>() - first]
    }
}

/// A batch as the model takes it.
#[derive(Clone, Debug)]
pub struct Batch {
    pub layout: Arc<SequenceLayout>,
    /// `[n_text_rows, d_text]`, all prefixes after one another.
    pub text: Vec<f32>,
    /// The clip's length of each text row.
    pub text_lengths: Arc<[u32]>,
    /// The slot of each row of the first scale, and its clip's length.
    pub starts: Arc<[u32]>,
    pub start_lengths: Arc<[u32]>,
    /// `[n_later_rows, c]`, the inputs of the other scales.
    pub inputs: Vec<f32>,
    /// The scale of each of their rows.
    pub levels: Arc<[u32]>,
    /// The source of each row of the batch: a text row, then rows of the first scale, then of the others.
    pub order: Arc<[u32]>,
    /// The supervised codes of each scale.
    pub targets: Vec<Supervised>,
}

impl Batch {
    /// Packs clips.
    pub fn pack(clips: &[Clip], grid: &Grid, d_text: usize, places: &Places) -> Self {
        let sizes: Vec<[usize; 3]> = clips.iter().map(|clip| clip.rows(d_text)).collect();
        let sequence = |(clip, [n_text, ..]): (&Clip, &[usize; 3])| {
            let scales = clip.lengths.iter().enumerate();
            let codes = scales.flat_map(|(scale, &n)| places.scale(scale, n));
            let angles = places.text(*n_text).chain(codes).map(|angle| angle as u32).collect();
            BlockSequence { prefix: *n_text, blocks: clip.lengths.clone().into(), angles }
        };
        let sequences: Vec<BlockSequence> = clips.iter().zip(&sizes).map(sequence).collect();
        let lengths = |sort: usize| {
            let lengths = clips.iter().map(|clip| clip.length as u32).zip(&sizes);
            lengths.flat_map(move |(length, own)| std::iter::repeat_n(length, own[sort])).collect()
        };
        let levels = clips.iter().flat_map(|clip| {
            let later = clip.lengths.iter().enumerate().skip(1);
            later.flat_map(|(scale, &n)| std::iter::repeat_n(scale as u32, n))
        });
        Self {
            layout: Arc::new(SequenceLayout::in_blocks(&sequences).expect("clips have rows")),
            text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
            text_lengths: lengths(0),
            starts: sizes.iter().flat_map(|own| 0..own[1] as u32).collect(),
            start_lengths: lengths(1),
            inputs: clips.iter().flat_map(|clip| clip.inputs.iter().flatten()).copied().collect(),
            levels: levels.collect(),
            order: packed(&sizes).0,
            targets: supervised(clips, &sizes, grid.scales.len()),
        }
    }

    /// Supervised codes.
    pub fn n_targets(&self) -> usize {
        n_supervised(&self.targets)
    }
}

/// The supervised codes of each scale, for clips with these numbers of rows.
fn supervised(clips: &[Clip], sizes: &[[usize; 3]], n_scales: usize) -> Vec<Supervised> {
    let (mut first, mut targets) = (0, vec![<(Vec<u32>, Vec<u32>)>::default(); n_scales]);
    for (clip, size) in clips.iter().zip(sizes) {
        let (first_code, mut start) = (first + size[0], 0);
        for ((rows, codes), n) in targets.iter_mut().zip(&clip.lengths) {
            let own = clip.supervised.start.max(start)..clip.supervised.end.min(start + n);
            rows.extend(own.clone().map(|i| (first_code + i) as u32));
            codes.extend(own.map(|i| clip.codes[i]));
            start += n;
        }
        first += size.iter().sum::<usize>();
    }
    targets.into_iter().map(Supervised::from).collect()
}

// [`Places`]: times of text and codes, for the angles of attention.

/// The span of a clip, whatever the length of a scale: codes of one time have one angle (LG-Tok).
const SPAN: f64 = 64.0;

/// The angles of text and of every slot of every scale.
///
/// The last word of a text is at −1 and the others before it. Slot j of a scale of s codes is at the middle of its span,
/// 64 (j + ½) / s, with s the scale's length, or the longest clip's if a code covers a fixed number of frames.
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
    pub fn text(&self, n: usize) -> Range<usize> {
        self.max_text - n..self.max_text
    }

    /// The angles of the first `n` slots of a scale.
    pub fn scale(&self, scale: usize, n: usize) -> Range<usize> {
        self.starts[scale]..self.starts[scale] + n
    }
}
