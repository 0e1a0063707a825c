//! Estimates the peak memory of jobs, from measurements.

use crate::data::DataFacts;
use crate::motion::N_FEATURES;
use crate::spec::{
    BegunFrom, EvaluatorSpec, MatchingSpec, NetworksSpec, Precision, RunSpec, TextSpec,
    TokenizerSpec, TokenizerTrainer,
};

/// Bytes of a frame's features in the pool of a tokenizer, with the allocator's overhead.
const POOL_BYTES_PER_FRAME: f64 = 1.1 * 4.0 * N_FEATURES as f64;

/// Frames that are tokenised together.
const FRAMES_ENCODED: f64 = 2048.0;

/// Memory of the runtime and the data's statistics in a worker that reads motion.
const MOTION_BASE_BYTES: f64 = 30e6;

/// Memory of PyTorch before its first tensor: 500 MB of libraries were measured, and 100 MB more after reading clips
/// and weights.
const TORCH_BASE_BYTES: f64 = 600e6;

/// Copies of the pool that a worker holds while it writes it for another trainer.
const POOLS_WRITTEN: f64 = 3.0;

/// Bytes of a patch that weights begin from: the features of four frames, twice.
const BYTES_PER_PATCH: f64 = 2.0 * 4.0 * 4.0 * N_FEATURES as f64;

/// Peak private bytes of training a tokenizer: its pool of clips, plus the channels kept for the backward pass for each
/// frame of a step; or the k-means baseline, if that is more.
///
/// Measured at widths 16, 64 and 128 with a pool of 2048 clips: 400, 430 and 463 MB, within 3 % of
/// this; the bytes per channel at depths 1 to 6 and 8 to 128 windows per step, within 20 %.
pub fn tokenizer_peak_bytes(spec: &TokenizerSpec, data: &DataFacts) -> u64 {
    let [train, ..] = data.clips;
    let frames_per_clip = data.train_frames() as f64 / train.max(1) as f64;
    let pool_frames = |spec: &TokenizerSpec| {
        let images = if spec.training.mirror { 2.0 } else { 1.0 };
        images * spec.training.pool_clips.min(train) as f64 * frames_per_clip
    };
    // A pool has no more patches than frames.
    let begun = |spec: &TokenizerSpec| {
        let Some(BegunFrom { weights, codes }) = spec.begun_from() else { return 0.0 };
        let most = pool_frames(spec);
        let bytes_per_latent = 3.0 * 4.0 * spec.architecture.code_dim() as f64;
        BYTES_PER_PATCH * most.min(weights as f64) + bytes_per_latent * most.min(codes as f64)
    };
    let pool = |spec: &TokenizerSpec| POOL_BYTES_PER_FRAME * pool_frames(spec);
    let frames = (spec.training.batch * spec.training.window) as f64;
    let step = frames * spec.training_bytes_per_frame();
    let training = match spec.trainer {
        TokenizerTrainer::BuiltIn => pool(spec) + step.max(begun(spec)),
        TokenizerTrainer::Torch => {
            (POOLS_WRITTEN * pool(spec)).max(TORCH_BASE_BYTES + pool(spec) + step)
        }
    };
    let beside = spec.k_means_beside().map_or(0.0, |spec| pool(&spec) + begun(&spec));
    (MOTION_BASE_BYTES + training.max(beside)) as u64
}

/// Peak private bytes of tokenising a data set: a batch of clips in the encoder, and all codes twice.
///
/// Measured at widths 16, 64 and 128: 35, 42 and 82 MB; this estimates 37, 55 and 78.
pub fn tokens_peak_bytes(spec: &TokenizerSpec, data: &DataFacts) -> u64 {
    let codes = 2.0 * 4.0 * data.unique_tokens(&spec.grid()) as f64;
    (MOTION_BASE_BYTES + FRAMES_ENCODED * spec.architecture.encoding_bytes_per_frame() + codes)
        as u64
}

/// Bytes of a loaded evaluator for each square of its width: its 82 numbers three times while it is read, and a batch.
/// At width 512 and 200 clips 512 MB were measured, program included; this estimates 470.
const LOADED_BYTES: f64 = 1500.0;

/// Peak private bytes of an evaluator: its pool of clips and of their corrupted copies, plus the values kept for the
/// backward pass for each row of a step; or the test clips with corrupted copies.
pub fn evaluator_peak_bytes(spec: &EvaluatorSpec, data: &DataFacts) -> u64 {
    let [train, _, test] = data.clips;
    let frames_per_clip = data.train_frames() as f64 / train.max(1) as f64;
    let n_features = spec.representation.n_features(N_FEATURES) as f64;
    let sides = if spec.n_corrupted() > 0 { 2.0 } else { 1.0 };
    let pool = sides * spec.pool_clips.min(train) as f64 * frames_per_clip * 4.4 * n_features;
    let motion = frames_per_clip.min(spec.window as f64) / spec.frames() as f64;
    let rows =
        (spec.batch + spec.n_corrupted()) as f64 * motion + (spec.batch * WORDS_PER_CAPTION) as f64;
    let step = rows * spec.networks.training_bytes_per_row();
    let gates = 2.0 * 4.0 * N_FEATURES as f64 * test as f64 * frames_per_clip;
    let peak = match (&spec.loaded, &spec.networks) {
        (Some(_), NetworksSpec::Matching(MatchingSpec { width, .. })) => {
            LOADED_BYTES * (*width as f64).powi(2) + gates
        }
        _ => (pool + step).max(gates),
    };
    (MOTION_BASE_BYTES + peak) as u64
}

/// Memory of the runtime and an encoder before the first caption.
const TEXT_BASE_BYTES: f64 = 40e6;

/// Captions per clip, and words per caption, to estimate the memory of their vectors.
const CAPTIONS_PER_CLIP: usize = 3;
const WORDS_PER_CAPTION: usize = 12;

/// Peak bytes that embedding the captions of a data set has to itself: every vector three times while
/// the file is written. Captions that are alike are embedded once: 162 MB where 160 were measured
/// (4416 clips, width 64), and less where captions repeat.
pub fn text_peak_bytes(spec: &TextSpec, data: &DataFacts) -> u64 {
    let captions = data.clips.iter().sum::<usize>() * CAPTIONS_PER_CLIP;
    let words = captions * WORDS_PER_CAPTION.min(spec.max_tokens);
    (TEXT_BASE_BYTES + 3.0 * 4.0 * (words * spec.dim) as f64) as u64
}

/// Rows of a batch for each supervised token: captions come on top.
const ROWS_PER_TARGET: f64 = 1.6;

/// Logits that the head holds at once, at most.
const LOGITS_AT_ONCE: f64 = (1 << 28) as f64;

/// Memory of CUDA and its kernels without a model.
const CONTEXT_BYTES: f64 = 1e9;

/// GPU bytes of a run trained by PyTorch; the trainer ends before its first step if fewer are free. On an H200 at 44M
/// and 343M, V = 1024 and 65,536, 0.8 to 1.2 of this was measured.
///
/// 16 N + rows · n_layer · (8 d + b (8 d + 3 d_ff)) + logits · (8 + 2 b) + 1e9, where
///
/// - N: all parameters; weights, gradients and two moments in f32
/// - rows: 1.6 for each supervised token of a batch
/// - b: bytes of a number in products, 2 in bf16 and 4 in f32
/// - 8 d: the inputs of both halves of a block, in f32; 8 d + 3 d_ff: operands and results of its products
/// - logits: batch_tokens · V, at most 2²⁸ at once
pub fn bytes_on_card(spec: &RunSpec) -> u64 {
    let (shape, targets) = (spec.shape(), spec.batch_tokens as f64);
    let bytes = if spec.precision == Precision::F32 { 4.0 } else { 2.0 };
    let (d, d_ff) = (shape.d_model as f64, shape.d_ff as f64);
    let of_row = shape.n_layer as f64 * (8.0 * d + bytes * (8.0 * d + 3.0 * d_ff));
    let logits = LOGITS_AT_ONCE.min(targets * spec.n_vocab() as f64);
    let parameters = 16.0 * spec.params().total() as f64;
    let kept = ROWS_PER_TARGET * targets * of_row;
    (parameters + kept + logits * (8.0 + 2.0 * bytes) + CONTEXT_BYTES) as u64
}
