//! Cells with their price: what each costs, or why it is dropped.

use super::cells::{GridCell, cells};
use super::priced_cell::{Dropped, PricedCell};
use super::steps::{pace, spend};
use super::trunk;
use crate::spec::Context;
use crate::sweep::{Sweep, shape};

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

fn price_cell(sweep: &Sweep, cell: &GridCell) -> Result<PricedCell, String> {
    let tokenizer = sweep.tokenizer.spec(cell.quantizer.clone(), &sweep.text);
    let codes = tokenizer.grid();
    let context = Context {
        max_text: sweep.text.max_tokens,
        d_latent: tokenizer.architecture.code_dim(),
        frames_per_latent: tokenizer.architecture.frames_per_latent(),
        corruption: sweep.model.corruption,
        text_drop: sweep.model.text_drop,
    };
    let shape = shape(&cell.model, &sweep.model, &sweep.text);
    let generator = cell.generator.of(shape, &codes, &context);
    let flops_per_token = generator.flops_per_token(&codes, sweep.text.max_tokens);
    let per_token = flops_per_token.by(sweep.flops.rule);
    let spending = spend(cell.budget_flops, per_token, &sweep.train)?;
    let params = generator.params(&codes);
    Ok(PricedCell {
        group: None,
        pace: pace(&params, spending.tokens(), spending, &sweep.train),
        params,
        generator,
        quantizer: cell.quantizer.clone(),
        codes,
        budget_flops: cell.budget_flops,
        share: cell.share,
        flops_per_token,
        spending,
    })
}
