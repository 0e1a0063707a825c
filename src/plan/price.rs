//! Cells with their price: what each costs, or why it is dropped.

use serde::Serialize;

use super::steps::{Pace, Spending, pace, spend};
use super::trunk;
use crate::plan::cells::{Cell, cells};
use crate::spec::QuantizerSpec;
use crate::spec::flops::{exact_of_sequence, openai_per_token, six_nd_per_token};
use crate::spec::{ModelShape, ParamCounts};
use crate::sweep::{FlopsRule, Sweep};

/// Forward FLOPs a supervised token, by every convention.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FlopsPerToken {
    pub openai: u64,
    #[serde(rename = "6nd")]
    pub six_nd: f64,
    /// At full context: a prefix of the longest text and every motion slot but the spare one.
    pub exact: f64,
}

impl FlopsPerToken {
    /// The three counts for a model with a vocabulary.
    pub fn new(shape: &ModelShape, n_vocab: usize, prefix: usize) -> Self {
        let targets = (shape.n_ctx - prefix - 1) as f64;
        Self {
            openai: openai_per_token(shape, n_vocab),
            six_nd: six_nd_per_token(shape, n_vocab),
            exact: exact_of_sequence(shape, n_vocab, prefix as f64, targets) / targets,
        }
    }

    /// The count of one convention.
    pub fn by(&self, rule: FlopsRule) -> f64 {
        match rule {
            FlopsRule::OpenAi => self.openai as f64,
            FlopsRule::SixNd => self.six_nd,
            FlopsRule::Exact => self.exact,
        }
    }
}

/// A cell that can be trained.
#[derive(Clone, Debug)]
pub struct PricedCell {
    pub shape: ModelShape,
    pub quantizer: QuantizerSpec,
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
            n_layer: self.shape.n_layer,
            n_head: self.shape.n_head,
            d_model: self.shape.d_model,
            n_vocab: self.quantizer.n_vocab(),
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
    let (kept, excluded) = cells(&sweep.grid, sweep.tokenizer.kind);
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
    let shape = crate::sweep::shape(&cell.model, &sweep.model, &sweep.text);
    let n_vocab = cell.quantizer.n_vocab();
    let flops_per_token = FlopsPerToken::new(&shape, n_vocab, sweep.text.max_tokens);
    let per_token = flops_per_token.by(sweep.flops.rule);
    let spending = spend(cell.budget_flops, per_token, &sweep.train)?;
    let params = shape.params(n_vocab);
    let trained = params.nonvocab + params.vocab;
    Ok(PricedCell {
        group: None,
        pace: pace(trained, spending.tokens(), spending, &sweep.train),
        params,
        shape,
        quantizer: cell.quantizer.clone(),
        budget_flops: cell.budget_flops,
        flops_per_token,
        spending,
    })
}
