//! [`Draw`]: a code from a model's logits.

use std::ops::Range;

use burn::tensor::Tensor;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::learn::params::unit;

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
        let total: f64 = rest.iter().map(|(_, p)| p).sum();
        let mut left = unit(rng) * total;
        for &(code, p) in &rest {
            left -= p;
            if left < 0.0 {
                return code;
            }
        }
        rest[rest.len() - 1].0
    }

    /// A code of those that have logits, each of which may follow.
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
}
