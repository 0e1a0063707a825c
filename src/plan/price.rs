//! Cells with their price: what each costs, or why it is dropped.

use serde::Serialize;

use super::cells::{Cell, cells};
use super::steps::{Pace, Spending, pace, spend};
use super::trunk;
use crate::spec::{FlopsPerToken, GeneratorSpec, Grid, ParamCounts, TokenizerSpec};
use crate::sweep::{Sweep, shape};

/// A cell that can be trained.
#[derive(Clone, Debug)]
pub struct PricedCell {
    pub generator: GeneratorSpec,
    pub tokenizer: TokenizerSpec,
    /// The codes that the tokenizer gives clips.
    pub codes: Grid,
    pub budget_flops: f64,
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

    /// The cell as one that is left out.
    pub fn dropped(&self, reason: String) -> Dropped {
        Dropped {
            n_layer: self.generator.shape().n_layer,
            n_head: self.generator.shape().n_head,
            d_model: self.generator.shape().d_model,
            n_vocab: self.codes.n_vocab(),
            budget_flops: self.budget_flops,
            reason,
        }
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
    pub reason: String,
}

impl Dropped {
    fn new(cell: &Cell, reason: String) -> Self {
        Self {
            n_layer: cell.model.n_layer,
            n_head: cell.model.n_head,
            d_model: cell.model.d_model,
            n_vocab: cell.quantizer.n_vocab(),
            budget_flops: cell.budget_flops,
            reason,
        }
    }
}

/// Prices every cell of a sweep's grid.
pub fn price(sweep: &Sweep) -> (Vec<PricedCell>, Vec<Dropped>) {
    let (kept, excluded) = cells(sweep);
    let mut dropped: Vec<Dropped> =
        excluded.into_iter().map(|(cell, reason)| Dropped::new(&cell, reason)).collect();
    let mut priced = Vec::with_capacity(kept.len());
    for cell in kept {
        match price_cell(sweep, &cell) {
            Ok(cell) => priced.push(cell),
            Err(reason) => dropped.push(Dropped::new(&cell, reason)),
        }
    }
    if sweep.train.schedule.shares() {
        let (in_step, out) = trunk::in_step(priced, &sweep.train);
        dropped.extend(out);
        return (in_step, dropped);
    }
    (priced, dropped)
}

fn price_cell(sweep: &Sweep, cell: &Cell) -> Result<PricedCell, String> {
    let generator = cell.generator.of(shape(&cell.model, &sweep.model, &sweep.text));
    let tokenizer = sweep.tokenizer.spec(cell.quantizer.clone());
    let codes = tokenizer.grid();
    let flops_per_token = generator.flops_per_token(&codes, sweep.text.max_tokens);
    let per_token = flops_per_token.by(sweep.flops.rule);
    let spending = spend(cell.budget_flops, per_token, &sweep.train)?;
    let params = generator.params(&codes);
    let trained = params.nonvocab + params.vocab;
    Ok(PricedCell {
        group: None,
        pace: pace(trained, spending.tokens(), spending, &sweep.train),
        params,
        generator,
        tokenizer,
        codes,
        budget_flops: cell.budget_flops,
        flops_per_token,
        spending,
    })
}
