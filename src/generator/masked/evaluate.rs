//! A bound on the loss of the first scale on a split.
//!
//! A masked model gives no likelihood, but a bound on it: codes in any order, each from those before it
//! in that order (Uria et al. 2014; Hoogeboom et al. 2022, "Autoregressive Diffusion Models"). With
//! m hidden codes of n, m drawn evenly from 1 to n and the hidden ones at random, the mean over them of
//! −ln p is a bound on the nats of a code. Each clip is measured at [`MASKS`] values of m, spread evenly.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::batch::{Hidden, pack};
use crate::generator::Inputs;
use crate::generator::autoregressive::Model;
use crate::generator::passes::passes;
use crate::generator::sums::SplitSums;
use crate::progress::moved;

/// How often each clip is measured.
const MASKS: usize = 4;

/// Seeds what is hidden: the same for every model.
const SEED: u64 = 0;

/// Takes in what a model has on the codes of the first scale, each clip with one of its captions.
pub fn bound(model: &Model, inputs: &Inputs, sums: &mut SplitSums) {
    let (tokens, split) = (inputs.tokens, sums.split);
    let n_vocab = tokens.grid().scales[0].n_vocab;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    for clips in passes(tokens, split) {
        for mask in 0..MASKS {
            let hidden = clips.clone().map(|clip| {
                let text = inputs.text.shown(split, clip);
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
                sums.add_nats(clip, weight * own.by_ref().take(n_hidden).sum::<f64>());
            }
            moved();
        }
        clips.for_each(|clip| sums.add_unigrams(clip));
    }
}

/// How many of `n` codes are hidden: the values of all masks and clips are spread evenly from 1 to n.
fn spread(n: usize, mask: usize, clip: usize) -> usize {
    // Clips are shifted against one another by the golden section, which fills a span evenly.
    let shift = (clip as f64 * 0.618_033_988_749_895).fract();
    let share = (mask as f64 + shift) / MASKS as f64;
    1 + (share * n as f64) as usize
}
