//! [`Batch`]: clips packed row after row, text first, then scale after scale.

use crate::codes::{Grid, Length};
use crate::data::Split;
use crate::generator::Inputs;
use crate::generator::stack::{Supervised, n_supervised};
use crate::ops::{BlockSequence, Rope, SequenceLayout};
use crate::spec::ScalewiseSpec;
use std::ops::Range;
use std::sync::Arc;

/// One clip as the model is shown it.
#[derive(Clone, Debug)]
pub struct Clip<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The codes that it should predict, scale after scale, those of one codebook from 0.
    pub codes: &'a [u32],
    /// Codes of each scale.
    pub lengths: Vec<usize>,
    /// What each scale but the first is shown, `[s, c]` row-major.
    pub inputs: Vec<Vec<f32>>,
    /// Its length in latents.
    pub n_latents: usize,
    /// The codes that are supervised.
    pub supervised: Range<usize>,
}

impl<'a> Clip<'a> {
    /// A clip of a split whose scales are shown what `shown` makes of its codes and their numbers.
    pub fn of(
        (inputs, grid): (&Inputs<'a>, &Grid),
        (split, index): (Split, usize),
        (text, supervised): (&'a [f32], Range<usize>),
        shown: impl FnOnce(&[u32], &[usize]) -> Vec<u32>,
    ) -> Self {
        let scales = inputs.scales.expect("the job opens the tokenizer for a kind that wants it");
        let codes = inputs.tokens.clip(split, index);
        let n_frames = inputs.tokens.clip_frames(split, index);
        let lengths: Vec<usize> = grid.lengths(n_frames).collect();
        let inputs = scales.inputs(&shown(codes, &lengths), 1, n_frames);
        let n_latents = scales.n_latents(n_frames);
        Self { text, codes, lengths, inputs, n_latents, supervised }
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
    /// For each row of the batch, where it comes from: a text row, a row of the first scale after all
    /// text rows, or a row of another after these.
    pub order: Arc<[u32]>,
    /// What is supervised of each scale.
    pub targets: Vec<Supervised>,
}

impl Batch {
    /// Packs clips.
    pub fn pack(clips: &[Clip], grid: &Grid, d_text: usize, places: &Places) -> Self {
        let n_text_rows = clips.iter().map(|clip| clip.text.len() / d_text).sum::<usize>();
        let n_starts = clips.iter().map(|clip| clip.lengths[0]).sum::<usize>();
        let mut packing = Packing {
            next: [0, n_text_rows, n_text_rows + n_starts],
            targets: vec![Default::default(); grid.scales.len()],
            ..Packing::default()
        };
        clips.iter().for_each(|clip| packing.add(clip, clip.text.len() / d_text, places));
        Self {
            layout: Arc::new(
                SequenceLayout::in_blocks(&packing.sequences).expect("clips have rows"),
            ),
            text: clips.iter().flat_map(|clip| clip.text).copied().collect(),
            text_lengths: packing.text_lengths.into(),
            starts: packing.starts.into(),
            start_lengths: packing.start_lengths.into(),
            inputs: clips.iter().flat_map(|clip| clip.inputs.iter().flatten()).copied().collect(),
            levels: packing.levels.into(),
            order: packing.order.into(),
            targets: packing.targets.into_iter().map(Supervised::from).collect(),
        }
    }

    /// Supervised codes.
    pub fn n_targets(&self) -> usize {
        n_supervised(&self.targets)
    }
}

/// A batch that is being packed.
#[derive(Default)]
struct Packing {
    sequences: Vec<BlockSequence>,
    text_lengths: Vec<u32>,
    starts: Vec<u32>,
    start_lengths: Vec<u32>,
    levels: Vec<u32>,
    order: Vec<u32>,
    /// Rows and codes of each scale.
    targets: Vec<(Vec<u32>, Vec<u32>)>,
    /// The next rows of text, of the first scale, and of the others.
    next: [usize; 3],
}

impl Packing {
    fn add(&mut self, clip: &Clip, n_text: usize, places: &Places) {
        let length = clip.n_latents as u32;
        let first = self.order.len() + n_text;
        self.take(0, n_text);
        self.text_lengths.extend(std::iter::repeat_n(length, n_text));
        let mut angles: Vec<u32> = places.text(n_text).map(|angle| angle as u32).collect();
        for (scale, &n) in clip.lengths.iter().enumerate() {
            self.take(if scale == 0 { 1 } else { 2 }, n);
            angles.extend(places.scale(scale, n).map(|angle| angle as u32));
            if scale == 0 {
                self.starts.extend(0..n as u32);
                self.start_lengths.extend(std::iter::repeat_n(length, n));
            } else {
                self.levels.extend(std::iter::repeat_n(scale as u32, n));
            }
        }
        self.supervise(clip, first);
        let blocks = clip.lengths.clone().into();
        self.sequences.push(BlockSequence { prefix: n_text, blocks, angles });
    }

    /// The next `n` rows of a kind join the batch.
    fn take(&mut self, kind: usize, n: usize) {
        let from = self.next[kind];
        self.order.extend((from..from + n).map(|row| row as u32));
        self.next[kind] += n;
    }

    fn supervise(&mut self, clip: &Clip, first: usize) {
        let mut start = 0;
        for ((rows, codes), n) in self.targets.iter_mut().zip(&clip.lengths) {
            let own = clip.supervised.start.max(start)..clip.supervised.end.min(start + n);
            rows.extend(own.clone().map(|i| (first + i) as u32));
            codes.extend(own.map(|i| clip.codes[i]));
            start += n;
        }
    }
}

// [`Places`]: where text and codes stand in time, for the angles of attention.

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
    pub fn text(&self, n: usize) -> Range<usize> {
        self.max_text - n..self.max_text
    }

    /// The angles of the first `n` slots of a scale.
    pub fn scale(&self, scale: usize, n: usize) -> Range<usize> {
        self.starts[scale]..self.starts[scale] + n
    }
}
