//! [`TestNoise`]: what losses and optima would be on other test splits.

use serde::{Deserialize, Serialize};

use crate::laws::input::cell::Cell;
use crate::laws::maths::random::Normals;

/// Keeps the streams of other test splits apart from those of replicates.
const STREAMS: u64 = 1 << 41;

/// How losses differ between test splits like the one that runs were measured on.
///
/// The split is parted into B blocks that have no recording in common. By d_b = a_b + s_b · (ln N_nv, ln V,
/// ln C) block b is harder than the mean of all, with the logarithms from those of the best cell of the
/// largest budget; the loss of a cell then has the variance Σ d_b²/B(B − 1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestNoise {
    /// Standard deviation of the loss of that best cell, in nats.
    pub sd: f64,
    /// B.
    pub blocks: usize,
    centre: [f64; 3],
    /// a_b and s_b of each block.
    effects: Vec<[f64; 4]>,
}

impl TestNoise {
    /// Of the effects of two blocks at least around a cell.
    pub(in crate::laws) fn new(centre: [f64; 3], effects: Vec<[f64; 4]>) -> Self {
        let own = Self { sd: 0.0, blocks: effects.len(), centre, effects };
        Self { sd: own.sd_at(centre), ..own }
    }

    /// Standard deviation of the loss of a model (ln N_nv, ln V, ln C).
    fn sd_at(&self, place: [f64; 3]) -> f64 {
        let away: [f64; 3] = std::array::from_fn(|i| place[i] - self.centre[i]);
        let harder = |[level, slopes @ ..]: &[f64; 4]| {
            level + slopes.iter().zip(away).map(|(slope, x)| slope * x).sum::<f64>()
        };
        self.effects.iter().map(|own| harder(own).powi(2)).sum::<f64>().sqrt() * self.of_mean()
    }

    /// Losses of a model on this test split as ones on others.
    pub fn moved(&self, losses: &[f64], place: [f64; 3]) -> Vec<f64> {
        let sd = self.sd_at(place);
        let moved = |(i, loss): (usize, &f64)| {
            let mut normals = Normals::of_stream(STREAMS, i as u64);
            loss + sd * self.student(&mut normals) * normals.draw()
        };
        losses.iter().enumerate().map(moved).collect()
    }

    /// What another test split moves the optima of budgets by.
    pub(in crate::laws) fn draw(&self, normals: &mut Normals) -> OtherClips {
        let scale = self.student(normals) * self.of_mean();
        let mut slopes = [0.0; 2];
        for [_, size, vocab, _] in &self.effects {
            let weight = scale * normals.draw();
            slopes[0] += weight * size;
            slopes[1] += weight * vocab;
        }
        OtherClips(slopes)
    }

    /// The factor by which a deviation that so many blocks tell may be too small.
    fn student(&self, normals: &mut Normals) -> f64 {
        let dof = self.blocks - 1;
        (dof as f64 / normals.chi_square(dof)).sqrt()
    }

    /// 1/√(B(B − 1)).
    fn of_mean(&self) -> f64 {
        1.0 / ((self.blocks * (self.blocks - 1)) as f64).sqrt()
    }
}

/// How another test split is harder for larger models and vocabularies than for smaller ones. What it is
/// harder by for all models of a budget moves no optimum.
pub(in crate::laws) struct OtherClips([f64; 2]);

impl OtherClips {
    /// What the loss of a cell moves by beside that of the best of its budget.
    pub fn shift(&self, cell: &Cell, best: &Cell) -> f64 {
        let ln = |own: &Cell| [own.params_nonvocab.ln(), own.n_vocab.max(1.0).ln()];
        let (own, best) = (ln(cell), ln(best));
        (0..2).map(|axis| self.0[axis] * (own[axis] - best[axis])).sum()
    }
}
