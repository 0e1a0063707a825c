//! Replicates of a sweep, for intervals.
//!
//! A replicate keeps every cell of the sweep and adds to its mean loss a normal draw of the runs'
//! own noise, σ/√S for a cell of S runs; minima and laws are then found anew. σ is estimated
//! ([`run_noise`](crate::laws::noise::run_noise)), so each replicate draws its own, σ √(ν/χ²_ν), which
//! makes the intervals as wide as Student's where the degrees of freedom ν are few. Where σ comes from
//! several runs of each cell this is the bootstrap clustered by seed, in its parametric form: drawing
//! among two or three runs with replacement would understate their variance by a half or a third.
//! Runs themselves are not drawn, because a resample leaves a third of the cells out, and the
//! intervals then hold the choice of the grid too and cover too often.
//!
//! The means hold the runs' noise already, and a replicate has it twice. What is chosen as the lowest
//! of several means, the vocabulary of each size, is so chosen under more noise than in the sweep.
//! Measured over simulated sweeps (`docs/coverage.md`), the percentiles of such replicates cover as
//! they should; basic intervals cover too little, and noise around a smooth surface instead of the
//! means brings in that surface's misfit.
//!
//! Four things move a replicate beside the runs' own noise. Tokenizers: all runs with a vocabulary move
//! together, by the scatter between its tokenizers. Misfit: where runs lie further from the curves
//! than they scatter, they are moved by as much more. The method: laws go through the minima of each
//! kind of curve in turn. The test split: cells move by what each finds harder on other clips than the
//! others do. Each can be asked for alone ([`Sources`]). The last moves laws alone: minima are compared
//! with forecasts that were measured on the same clips.
//!
//! A budget whose replicate has no minimum inside the grid is left out of that replicate's laws, as
//! the fit itself would leave it out, unless flagged minima are kept; then it counts with its best
//! run, as in the fit.
//!
//! Replicate i draws from ChaCha8's stream i of the seed, so the samples do not depend on the
//! number of threads.

use super::law_set::{Columns, law_set};
use super::sample::LawSample;
use crate::laws::input::method::MinimumMethod;
use crate::laws::input::options::FitOptions;
use crate::laws::maths::random::Normals;
use crate::laws::minima;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::run_noise::{NoiseSource, RunNoise};
use crate::laws::minima::types::Minimum;
use crate::laws::noise::test_noise::{OtherClips, TestNoise};
use crate::laws::noise::tokenizer_noise::TokenizerNoise;
use rayon::prelude::*;

/// What the replicates are made of.
#[derive(Clone)]
pub(in crate::laws) struct Bootstrap<'a> {
    /// The cells of each budget.
    pub grids: &'a [Grid],
    /// The kinds of minimum to find in each replicate.
    pub methods: &'a [MinimumMethod],
    /// The kind the laws are fitted to; one of `methods`.
    pub method: MinimumMethod,
    /// The minima that the laws are fitted to.
    pub used: &'a [Minimum],
    /// C0.
    pub reference: f64,
    pub noise: RunNoise,
    pub tokenizers: Option<&'a TokenizerNoise>,
    pub test: Option<&'a TestNoise>,
    /// How many times the variance of the runs their distance from the curves is; at least 1.
    pub misfit: f64,
    /// The kinds of minimum that laws may go through, as indices into `methods`.
    pub admissible: Vec<usize>,
    pub sources: Sources,
    pub options: &'a FitOptions,
}

/// What an interval holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::laws) struct Sources {
    pub runs: bool,
    pub tokenizers: bool,
    pub misfit: bool,
    pub method: bool,
    pub test: bool,
}

impl Sources {
    pub const ALL: Self =
        Self { runs: true, tokenizers: true, misfit: true, method: true, test: true };
}

/// What one replicate gave.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::laws) struct Replicate {
    /// None where fewer than two budgets have a minimum.
    pub laws: Option<ReplicateLaws>,
    /// N_nv, N_v and L of the minima: for each method every budget.
    pub minima: Vec<[f64; 3]>,
}

/// One replicate's coefficients, and the exponent of Eq. 10 where N_nv varied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct ReplicateLaws {
    pub sample: LawSample,
    pub vocab_from_nonvocab: Option<f64>,
}

impl Bootstrap<'_> {
    /// The replicates in order, as many as the options ask for.
    pub fn replicates(&self) -> Vec<Replicate> {
        (0..self.options.bootstrap).into_par_iter().map(|i| self.replicate(i as u64)).collect()
    }

    fn replicate(&self, stream: u64) -> Replicate {
        let mut normals = Normals::of_stream(self.options.seed, stream);
        let dof = self.noise.dof;
        let drawn_sd = (dof as f64 / normals.chi_square(dof)).sqrt();
        let tokenizers = self.tokenizers.filter(|_| self.sources.tokenizers);
        let shifts = tokenizers.map(|noise| noise.shifts(&mut normals)).unwrap_or_default();
        let clips = self.test.filter(|_| self.sources.test).map(|noise| noise.draw(&mut normals));
        let grids = self.grids.iter();
        let noisy = |grid: &Grid| {
            let sd = drawn_sd * self.sd_of_runs(grid);
            grid.with_losses(|cell| {
                cell.loss + shifts.of(cell.n_vocab) + sd / cell.runs.sqrt() * normals.draw()
            })
        };
        let drawn: Vec<Grid> = grids.map(noisy).collect();
        let of = |method| drawn.iter().map(move |grid| minima::of_grid(method, grid));
        let minima: Vec<Minimum> = self.methods.iter().copied().flat_map(of).collect();
        let fitted = self.method_of(stream).map(|own| match &clips {
            Some(clips) => self.on_other_clips(clips, self.methods[own], &drawn),
            None => minima[own * drawn.len()..][..self.grids.len()].to_vec(),
        });
        Replicate {
            laws: fitted.and_then(|fitted| self.laws(&fitted)),
            minima: minima
                .iter()
                .map(|m| [m.params_nonvocab, m.params_vocab, m.loss_normalised])
                .collect(),
        }
    }

    /// The minima of the fitted budgets on another test split.
    fn on_other_clips(
        &self,
        clips: &OtherClips,
        method: MinimumMethod,
        drawn: &[Grid],
    ) -> Vec<Minimum> {
        let moved =
            |grid: &Grid| grid.with_losses(|cell| cell.loss + clips.shift(cell, grid.best()));
        let fitted = drawn[..self.grids.len()].iter();
        fitted.map(|grid| minima::of_grid(method, &moved(grid))).collect()
    }

    /// Which kind of minimum a replicate's laws go through.
    fn method_of(&self, stream: u64) -> Option<usize> {
        match self.sources.method {
            true => self.admissible.get(stream as usize % self.admissible.len().max(1)).copied(),
            false => self.methods.iter().position(|method| *method == self.method),
        }
    }

    /// The standard deviation that a single run of a budget is moved by.
    fn sd_of_runs(&self, grid: &Grid) -> f64 {
        let Sources { runs, misfit, .. } = self.sources;
        let variance =
            f64::from(u8::from(runs)) + f64::from(u8::from(misfit)) * (self.misfit - 1.0);
        variance.sqrt() * of_budget(grid, self.noise)
    }

    /// The laws through the minima of the fitted budgets, those of the budgets used.
    fn laws(&self, fitted: &[Minimum]) -> Option<ReplicateLaws> {
        let is_used = |m: &&Minimum| {
            let used = self.used.iter().any(|used| used.budget_flops == m.budget_flops);
            used && (self.options.keep_flagged || !m.is_best_run_instead())
        };
        let used: Vec<Minimum> = fitted.iter().filter(is_used).cloned().collect();
        let columns = Columns::new(&used, self.grids, self.options);
        let laws = law_set(&columns, self.reference, self.options)?;
        Some(ReplicateLaws {
            sample: laws.sample()?,
            vocab_from_nonvocab: laws.vocab_from_nonvocab.map(|law| law.exponent),
        })
    }
}

/// Degrees of freedom that the scatter over all budgets counts as, beside a budget's own.
const POOLED_DOF: f64 = 5.0;

/// The scatter of one budget's runs: its own seeds', drawn towards that of all budgets where there are
/// few.
fn of_budget(grid: &Grid, pooled: RunNoise) -> f64 {
    if pooled.source != NoiseSource::Seeds {
        return pooled.sd;
    }
    let dof: usize = grid.cells.iter().map(|cell| cell.dof).sum();
    let spread: f64 = grid.cells.iter().map(|cell| cell.spread).sum();
    ((spread + POOLED_DOF * pooled.sd.powi(2)) / (dof as f64 + POOLED_DOF)).sqrt()
}
