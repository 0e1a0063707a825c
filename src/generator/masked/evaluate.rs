//! A bound on the loss of the first scale on a split.
//!
//! A masked model gives no likelihood, but a bound on it: codes in any order, each from those before it
//! in that order (Uria et al. 2014; Hoogeboom et al. 2022, "Autoregressive Diffusion Models"). With
//! m hidden codes of n, m drawn evenly from 1 to n and the hidden ones at random, the mean over them of
//! −ln p is a bound on the nats of a code. Each clip is measured at [`MASKS`] values of m, spread evenly.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Hidden, pack};
use crate::data::Split;
use crate::generator::autoregressive::Model;
use crate::generator::passes::passes;
use crate::generator::sums::{SplitSums, Sums};
use crate::generator::{Inputs, SplitLoss};
use crate::progress::moved;

/// How often each clip is measured.
const MASKS: usize = 4;

/// Seeds what is hidden: the same for every model.
const SEED: u64 = 0;

/// Measures a model of codes of one scale.
pub fn split_loss(model: &Model, inputs: &Inputs, split: Split) -> SplitLoss {
    let mut sums = SplitSums::new(1, inputs.tokens.n_clips(split));
    bound(model, inputs, split, &mut sums);
    SplitLoss::of(sums, inputs.tokens.n_frames(split))
}

/// Takes in what a model has on the codes of the first scale, each clip with one of its captions; clip i
/// shows caption i mod n.
pub fn bound(model: &Model, inputs: &Inputs, split: Split, sums: &mut SplitSums) {
    let tokens = inputs.tokens;
    let (unigram, n_vocab) = (tokens.unigram_log_probs(0), tokens.grid().scales[0].n_vocab);
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for clips in passes(tokens, split) {
        for mask in 0..MASKS {
            let hidden = clips.clone().map(|clip| {
                let captions = inputs.text.captions(split, clip);
                let text = inputs.text.embedding(captions[clip % captions.len()]);
                let codes = tokens.scale(split, clip, 0);
                let n_hidden = spread(codes.len(), mask, clip);
                Hidden::some(text, codes, n_hidden, n_vocab, &mut rng)
            });
            let hidden: Vec<Hidden> = hidden.collect();
            let batch = pack(&hidden, inputs.text.dim());
            let mut own = model.nll(&batch).into_iter();
            for (clip, hidden) in clips.clone().zip(&hidden) {
                // The mean over hidden codes stands for every code of the clip.
                let n_hidden = hidden.targets.len();
                let weight = hidden.shown.len() as f64 / (MASKS * n_hidden) as f64;
                let nats = weight * own.by_ref().take(n_hidden).sum::<f64>();
                take_in(sums, clip, Sums { nats, ..Sums::default() });
            }
            moved();
        }
        for clip in clips {
            let codes = tokens.scale(split, clip, 0);
            let ln_p = codes.iter().map(|&code| unigram[code as usize]);
            take_in(sums, clip, Sums::of([], ln_p));
        }
    }
}

/// Of the first scale of a clip.
fn take_in(sums: &mut SplitSums, clip: usize, own: Sums) {
    sums.scales[0] = sums.scales[0] + own;
    sums.clips[clip] = sums.clips[clip] + own;
}

/// How many of `n` codes are hidden: the values of all masks and clips are spread evenly from 1 to n.
fn spread(n: usize, mask: usize, clip: usize) -> usize {
    // Clips are shifted against one another by the golden section, which fills a span evenly.
    let shift = (clip as f64 * 0.618_033_988_749_895).fract();
    let share = (mask as f64 + shift) / MASKS as f64;
    1 + (share * n as f64) as usize
}
