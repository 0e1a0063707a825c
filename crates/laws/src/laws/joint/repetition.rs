//! What repeated data is worth by a joint law.

use super::JointLaw;
use super::loss::worth;
use crate::laws::maths::stats::interval95;

/// What passes over the data are worth to a model of the middle size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repetition {
    /// R: what all passes after the first are worth together, in first passes.
    pub r: f64,
    /// Of the runs' noise and scatter about the law; another form of the law may well lie outside.
    pub r_ci95: Option<[f64; 2]>,
    /// R falls as N^−ρ.
    pub rho: f64,
    pub rho_ci95: Option<[f64; 2]>,
    /// The middle N_nv of the cells, which R is that of.
    pub params_nonvocab: f64,
}

impl Repetition {
    /// First passes that so many passes are worth.
    pub fn worth(&self, passes: f64) -> f64 {
        worth(passes.ln(), Some(1.0), self.r.ln()).exp()
    }
}

impl JointLaw {
    /// What it says of repeated data; none where it has no term for it.
    pub fn repetition(&self) -> Option<Repetition> {
        let terms = self.loss.terms;
        terms.repeats.then(|| {
            let at = terms.ln_r();
            let all =
                |i: usize| self.bootstrap.iter().map(|values| values[at + i]).collect::<Vec<_>>();
            Repetition {
                r: self.loss.values[at].exp(),
                r_ci95: interval95(all(0)).map(|ends| ends.map(f64::exp)),
                rho: self.loss.values[at + 1],
                rho_ci95: interval95(all(1)),
                params_nonvocab: self.loss.centre[0].exp(),
            }
        })
    }
}
