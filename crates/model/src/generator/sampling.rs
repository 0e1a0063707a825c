//! Sampling shared by all kinds of generators: prompts, draws, and results.

use std::ops::Range;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::{GeneratorError, ScaleInputs};
use crate::draws::{stream, weighted};

/// The input of a motion.
#[derive(Clone, Copy, Debug)]
pub struct Prompt<'a> {
    /// Frozen text vectors, `[n_text, d_text]` row-major, at least one row.
    pub text: &'a [f32],
    /// The length asked for; `None` leaves it to the model.
    pub n_frames: Option<usize>,
    pub seed: u64,
    /// Tells motions of one seed apart: each draws from its own stream of random numbers.
    pub index: u64,
    /// A clip of the requested length to edit; `None` generates the whole motion.
    pub edit: Option<Edit<'a>>,
}

impl Prompt<'_> {
    /// The random numbers of the motion.
    pub fn rng(&self) -> ChaCha8Rng {
        stream(self.seed, self.index)
    }
}

/// Whether motions of so many frames fit a context, by the positions that they take with their text.
///
/// # Errors
/// [`GeneratorError::Length`].
pub fn check_length(
    n_frames: usize,
    n_ctx: usize,
    positions: impl Fn(usize) -> usize,
) -> Result<(), GeneratorError> {
    let fits = |frames: &usize| positions(*frames) <= n_ctx;
    if fits(&n_frames) {
        return Ok(());
    }
    let most = (0..n_frames).rev().find(fits).unwrap_or(0);
    Err(GeneratorError::Length { n_frames, positions: positions(n_frames), n_ctx, most })
}

/// A motion that is being made.
pub struct Making<'a> {
    pub text: &'a [f32],
    pub rng: ChaCha8Rng,
    /// Its codes so far, scale by scale.
    pub codes: Vec<u32>,
    pub n_frames: usize,
    /// The kept part, if it is edited.
    edit: Option<Edit<'a>>,
}

impl<'a> Making<'a> {
    /// A motion without a code.
    pub fn new(prompt: &Prompt<'a>, n_frames: usize) -> Self {
        let Prompt { text, edit, .. } = *prompt;
        Self { text, rng: prompt.rng(), codes: Vec::new(), n_frames, edit }
    }

    /// For each of the `n` codes of a scale after `before` codes, the code if it is kept.
    pub fn kept(&self, before: usize, n: usize) -> Vec<Option<u32>> {
        self.edit.map_or_else(|| vec![None; n], |edit| edit.kept(before, n))
    }

    /// The motion, which has met its length.
    pub fn done(self) -> Sampled {
        Sampled { codes: self.codes, n_frames: self.n_frames, ended: true }
    }
}

/// How motions are made.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sampling {
    pub draw: Draw,
    /// Strength of classifier-free guidance (Ho and Salimans 2022): (1 + s) conditional − s unconditional. 0 for
    /// none.
    pub guidance: f64,
    /// Rounds in which a masked model shows its codes.
    pub rounds: usize,
}

impl Default for Sampling {
    fn default() -> Self {
        Self { draw: Draw::default(), guidance: 0.0, rounds: 10 }
    }
}

impl Sampling {
    /// Whether a model can be guided that was trained without this share of the captions.
    ///
    /// # Errors
    /// [`GeneratorError::Guidance`].
    pub fn check_guidance(&self, text_drop: f64) -> Result<(), GeneratorError> {
        let refused = self.guidance > 0.0 && text_drop == 0.0;
        if refused { Err(GeneratorError::Guidance) } else { Ok(()) }
    }
}

/// The codes of a motion that was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sampled {
    /// As a tokenizer gives them: scale after scale.
    pub codes: Vec<u32>,
    /// Frames that they cover.
    pub n_frames: usize,
    /// Whether the model ended the motion, or had a length to meet; if not, its context was full.
    pub ended: bool,
}

/// A trained generator that makes motions.
pub trait Sampler {
    /// Whether a prompt has to say how long the motion is.
    fn wants_length(&self) -> bool {
        true
    }

    /// Whether motions can be moved away from those without text.
    fn takes_guidance(&self) -> bool {
        true
    }

    /// Makes a motion for each prompt, all at once; `scales` is the generator's
    /// [`Inputs::scales`](super::Inputs::scales).
    ///
    /// # Errors
    /// [`GeneratorError::Length`]: the length does not fit the model;
    /// [`GeneratorError::Guidance`]: it was never trained without text.
    fn sample(
        &self,
        prompts: &[Prompt],
        scales: &dyn ScaleInputs,
        sampling: &Sampling,
    ) -> Result<Vec<Sampled>, GeneratorError>;
}

/// A clip to edit: a part is generated again, the rest is kept (MoSa and LG-Tok; MoMask).
///
/// A code is drawn, given the kept ones that its generator sees, if all latents that it adds to are generated again: a
/// coarse code that reaches out of the part is kept.
#[derive(Clone, Copy, Debug)]
pub struct Edit<'a> {
    /// The clip's codes, scale after scale.
    pub codes: &'a [u32],
    /// For each latent, whether it is generated again.
    pub anew: &'a [bool],
}

impl Edit<'_> {
    /// For each of the `n` codes of a scale after `before` codes, the code if it is kept.
    pub fn kept(&self, before: usize, n: usize) -> Vec<Option<u32>> {
        let codes = &self.codes[before..before + n];
        self.places(n).into_iter().zip(codes).map(|(anew, &code)| (!anew).then_some(code)).collect()
    }

    /// The same for all codes of a clip that has so many on its scales.
    pub fn kept_of_all(&self, lengths: impl Iterator<Item = usize>) -> Vec<Option<u32>> {
        let mut before = 0;
        let of_scale = |n: usize| {
            before += n;
            self.kept(before - n, n)
        };
        lengths.flat_map(of_scale).collect()
    }

    /// For each of `n` codes that span the clip, whether it is generated again. Codes are stretched over the latents
    /// linearly, corners not aligned, so a latent has a share of two codes at most; a code without a latent, of more
    /// codes than latents, goes with the latent at its middle.
    fn places(&self, n: usize) -> Vec<bool> {
        let n_latents = self.anew.len();
        let middle = |code: usize| (2 * code + 1) * n_latents / (2 * n);
        let mut anew: Vec<bool> = (0..n).map(|code| self.anew[middle(code)]).collect();
        for (latent, &own) in self.anew.iter().enumerate() {
            let x = ((latent as f64 + 0.5) * n as f64 / n_latents as f64 - 0.5).max(0.0);
            let first = x as usize;
            let second = if x.fract() > 0.0 { (first + 1).min(n - 1) } else { first };
            anew[first] &= own;
            anew[second] &= own;
        }
        anew
    }
}

// [`Draw`]: a code from a model's logits.

/// How a code is drawn from the logits of a row.
///
/// Logits are divided by the temperature; of the codes that may follow, the `top_k` likeliest stay,
/// and of these the likeliest that together hold `top_p` of the probability (Holtzman et al. 2020).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Draw {
    /// 0 takes the likeliest code.
    pub temperature: f64,
    pub top_k: Option<usize>,
    pub top_p: Option<f64>,
}

impl Default for Draw {
    fn default() -> Self {
        Self { temperature: 1.0, top_k: None, top_p: None }
    }
}

impl Draw {
    /// A code among those in `allowed`, of which there is at least one.
    pub fn code(&self, logits: &[f32], allowed: &[Range<usize>], rng: &mut ChaCha8Rng) -> usize {
        let codes = allowed.iter().cloned().flatten();
        let mut rest: Vec<(usize, f64)> = codes.map(|i| (i, f64::from(logits[i]))).collect();
        rest.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        let best = rest[0];
        if self.temperature == 0.0 {
            return best.0;
        }
        rest.truncate(self.top_k.unwrap_or(rest.len()).max(1));
        rest.iter_mut().for_each(|(_, x)| *x = ((*x - best.1) / self.temperature).exp());
        self.keep_nucleus(&mut rest);
        rest[weighted(rest.iter().map(|(_, p)| *p), rng)].0
    }

    /// Draws a code from logits of the allowed codes.
    pub fn any_code(&self, logits: &[f32], rng: &mut ChaCha8Rng) -> u32 {
        self.code(logits, std::slice::from_ref(&(0..logits.len())), rng) as u32
    }

    /// The probability of a code by its logits alone.
    pub fn confidence(logits: &[f32], code: usize) -> f64 {
        let own = f64::from(logits[code]);
        1.0 / logits.iter().map(|x| (f64::from(*x) - own).exp()).sum::<f64>()
    }

    /// Leaves the likeliest codes that together hold `top_p`.
    fn keep_nucleus(&self, rest: &mut Vec<(usize, f64)>) {
        let Some(share) = self.top_p else { return };
        let enough = share * rest.iter().map(|(_, p)| p).sum::<f64>();
        let mut held = 0.0;
        let last = rest.iter().position(|(_, p)| {
            held += p;
            held >= enough
        });
        rest.truncate(last.map_or(rest.len(), |last| last + 1));
    }
}

/// The rows of logits, on the host.
pub fn rows(logits: Tensor<2>) -> Vec<Vec<f32>> {
    let [_, columns] = logits.dims();
    let values: Vec<f32> = logits.into_data().try_into_vec().expect("logits are f32");
    values.chunks_exact(columns).map(<[f32]>::to_vec).collect()
}

/// Moves rows of logits away from those without text, by (1 + s) with − s without.
pub fn guide(rows: &mut [Vec<f32>], without: &[Vec<f32>], strength: f64) {
    for (x, free) in rows.iter_mut().flatten().zip(without.iter().flatten()) {
        *x += strength as f32 * (*x - free);
    }
}

/// A row of logits a place, from those with text; where motions are guided, moved away from those without.
pub fn guided<'a>(
    pass: impl Fn(Option<&'a [f32]>) -> Vec<Vec<f32>>,
    no_text: &'a [f32],
    strength: f64,
) -> Vec<Vec<f32>> {
    let mut rows = pass(None);
    if strength != 0.0 {
        guide(&mut rows, &pass(Some(no_text)), strength);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::rand_core::SeedableRng;

    const LOGITS: [f32; 5] = [1.0, 3.0, 2.0, 9.0, 0.0];

    /// How often each of [`LOGITS`] is drawn in 20,000 draws among 0, 1, 2 and 4.
    fn shares(draw: Draw) -> [f64; 5] {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut counts = [0.0; 5];
        for _ in 0..20_000 {
            counts[draw.code(&LOGITS, &[0..3, 4..5], &mut rng)] += 1.0 / 20_000.0;
        }
        counts
    }

    #[test]
    fn codes_come_as_often_as_their_softmax_says() {
        let total: f64 = [1.0, 3.0, 2.0, 0.0].iter().map(|x: &f64| (x / 2.0).exp()).sum();
        let found = shares(Draw { temperature: 2.0, ..Draw::default() });
        for (code, share) in found.into_iter().enumerate() {
            let logit = f64::from(LOGITS[code]);
            let expected = if code == 3 { 0.0 } else { (logit / 2.0).exp() / total };
            assert!((share - expected).abs() < 0.012, "{code}: {share} {expected}");
        }
    }

    #[test]
    fn temperature_0_takes_the_likeliest_that_may_follow() {
        let found = shares(Draw { temperature: 0.0, ..Draw::default() });
        assert!((found[1] - 1.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn top_k_and_top_p_leave_the_likeliest() {
        let two = shares(Draw { top_k: Some(2), ..Draw::default() });
        assert!(two[0] == 0.0 && two[4] == 0.0 && two[1] > two[2] && two[2] > 0.0, "{two:?}");
        // e³ holds 0.64 of what codes 0, 1, 2 and 4 have, e³ and e² together 0.88.
        let only = shares(Draw { top_p: Some(0.6), ..Draw::default() });
        assert!(only[1] > 0.9999, "{only:?}");
        let both = shares(Draw { top_p: Some(0.8), ..Draw::default() });
        assert!(both[0] == 0.0 && both[2] > 0.2, "{both:?}");
    }

    fn places(anew: &[u8], n: usize) -> Vec<u8> {
        let anew: Vec<bool> = anew.iter().map(|&x| x == 1).collect();
        Edit { codes: &[], anew: &anew }.places(n).into_iter().map(u8::from).collect()
    }

    #[test]
    fn a_code_that_adds_to_a_latent_outside_of_the_part_is_kept() {
        assert_eq!(places(&[0, 1, 1, 0], 4), [0, 1, 1, 0]);
        assert_eq!(places(&[0, 1, 1, 0], 2), [0, 0]);
        assert_eq!(places(&[0, 1, 1, 1, 0], 1), [0]);
        // Of three codes for six latents the second adds to the latents 1 to 4, the last to 3 to 5.
        assert_eq!(places(&[0, 0, 0, 1, 1, 1], 3), [0, 0, 1]);
        assert_eq!(places(&[0, 0, 1, 1, 1, 1], 3), [0, 0, 1]);
        assert_eq!(places(&[0, 1, 1, 1, 1, 0], 3), [0, 1, 0]);
        // Of nine codes for three latents each latent has one, and the codes beside it go with it.
        assert_eq!(places(&[0, 1, 0], 9), [0, 0, 0, 1, 1, 1, 0, 0, 0]);
        assert_eq!(places(&[1, 1], 5), [1; 5]);
        assert_eq!(places(&[0, 0], 5), [0; 5]);
    }
}
