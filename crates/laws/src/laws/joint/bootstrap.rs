//! Replicates of a joint law.
//!
//! A replicate moves every cell around the law by the residuals' own deviation, which holds both the
//! noise of the runs and the law's misfit, moves all cells of a vocabulary together by the scatter of
//! its tokenizers, and cells by what each would find harder on another test split than others do, and fits the law anew.

use rayon::prelude::*;

use super::JointLaw;
use super::fit::refitted;
use super::weighed::place;
use crate::laws::input::cell::Cell;
use crate::laws::maths::random::Normals;
use crate::laws::minima::grid::Grid;
use crate::laws::noise::Scatter;

/// Keeps the streams of these replicates apart from those of minima.
const STREAMS: u64 = 1 << 40;

/// Residuals are taken for misfit up to so many times the scatter.
const MOST_MISFIT: f64 = 2.0;

/// The coefficients of `count` replicates of `law`, which was fitted to `grids`, drawn from a seed.
pub(in crate::laws) fn replicates(
    law: &JointLaw,
    grids: &[Grid],
    (scatter, seed): (Scatter, u64),
    count: usize,
) -> Vec<Vec<f64>> {
    let normals = |i| Normals::of_stream(seed, STREAMS + i);
    let streams = (0..count as u64).into_par_iter().map(normals);
    streams.map(|normals| replicate(law, grids, scatter, normals)).collect()
}

/// How many times what runs and tokenizers scatter by the residuals are; at least 1. What a form misses is
/// alike in neighbouring cells, and moves a law further than as much noise would.
fn misfit(law: &JointLaw, grids: &[Grid], Scatter { noise, tokenizers, .. }: Scatter) -> f64 {
    let Some(noise) = noise else { return 1.0 };
    let cells = grids.iter().flat_map(Grid::of_all_shares).flatten();
    let of_cell = |cell: &Cell| {
        let tokenizer = tokenizers.map_or(0.0, |noise| noise.of_mean(cell.n_vocab));
        noise.sd.powi(2) / cell.runs + tokenizer.powi(2)
    };
    let variance = cells.map(of_cell).sum::<f64>() / law.n as f64;
    let ratio = law.residual_sd / variance.sqrt();
    if ratio.is_finite() { ratio.clamp(1.0, MOST_MISFIT) } else { 1.0 }
}

fn replicate(law: &JointLaw, grids: &[Grid], scatter: Scatter, mut normals: Normals) -> Vec<f64> {
    let Scatter { noise, tokenizers, test } = scatter;
    let sd = law.residual_sd * (law.dof as f64 / normals.chi_square(law.dof)).sqrt();
    let sd = sd * misfit(law, grids, scatter);
    let shifts = tokenizers.map(|noise| noise.shifts(&mut normals)).unwrap_or_default();
    let clips = test.map(|noise| noise.draw(&mut normals));
    let cells = || grids.iter().flat_map(Grid::of_all_shares).flatten();
    let mean_runs = cells().map(|cell| cell.runs).sum::<f64>() / law.n as f64;
    let mut drawn = |cell: &Cell, best: &Cell| {
        let noise = sd * (mean_runs / cell.runs).sqrt() * normals.draw();
        let of_clips = clips.as_ref().map_or(0.0, |clips| clips.shift(cell, best));
        law.loss.value(&place(cell)) + shifts.of(cell.n_vocab) + of_clips + noise
    };
    let replicate = |grid: &Grid| grid.with_losses(|cell| drawn(cell, grid.best()));
    let drawn: Vec<Grid> = grids.iter().map(replicate).collect();
    refitted(law, (grids, &drawn), noise)
}
