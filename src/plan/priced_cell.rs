//! [`PricedCell`] and [`Dropped`]: a cell of the grid that can be trained, and one that cannot.

use serde::Serialize;

use super::cells::GridCell;
use super::steps::{Pace, Spending};
use crate::spec::{FlopsPerToken, GeneratorSpec, Grid, ParamCounts, Share};

/// A cell that can be trained.
#[derive(Clone, Debug)]
pub struct PricedCell {
    pub grid_cell: GridCell,
    pub generator: GeneratorSpec,
    /// The codes that the quantizer's tokenizer gives clips.
    pub codes: Grid,
    pub params: ParamCounts,
    pub flops_per_token: FlopsPerToken,
    pub spending: Spending,
    pub pace: Pace,
    /// Cells of one number share a trunk; `None` where nothing is shared.
    pub group: Option<usize>,
}

impl PricedCell {
    /// D that the budget buys, before whole steps are made of it.
    pub fn tokens_bought(&self) -> f64 {
        self.spending.tokens() as f64 / self.spending.achieved_ratio
    }
}

/// A cell that is left out, with its reason.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dropped {
    pub n_layer: usize,
    pub n_head: usize,
    pub d_model: usize,
    pub n_vocab: usize,
    pub budget_flops: f64,
    pub share: Share,
    pub reason: String,
}

impl Dropped {
    /// A cell of the grid.
    pub fn new(cell: &GridCell, reason: String) -> Self {
        Self {
            n_layer: cell.model.n_layer,
            n_head: cell.model.n_head,
            d_model: cell.model.d_model,
            n_vocab: cell.quantizer.n_vocab(),
            budget_flops: cell.budget_flops,
            share: cell.share,
            reason,
        }
    }
}
