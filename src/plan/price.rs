//! Prices cells: the cost of each, or why it is dropped.

use super::cells::{GridCell, cells};
use super::trunk::{
    Dropped, MOST_TOKENS, PricedCell, Spending, in_step, pace, spend_with, tokens_bought,
    widest_batch,
};
use crate::spec::{ClipShape, Context, FlopsPerToken, FlopsRule, GeneratorSpec, Grid, Pricing};
use crate::sweep::{Sweep, shape};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Prices every cell of a sweep's grid, over training clips of these shapes; none if they are not known.
pub fn price(sweep: &Sweep, clips: &BTreeMap<ClipShape, f64>) -> (Vec<PricedCell>, Vec<Dropped>) {
    let (kept, excluded) = cells(sweep);
    let mut dropped: Vec<Dropped> =
        excluded.into_iter().map(|(cell, reason)| Dropped::excluded(&cell, reason)).collect();
    let price = |cell: &GridCell| {
        price_cell(sweep, clips, cell).map_err(|reason| Dropped::new(cell, reason))
    };
    // Errors are on the left.
    let (unpriced, priced): (Vec<_>, Vec<_>) = kept.par_iter().map(price).partition_map(Into::into);
    dropped.extend(unpriced);
    if sweep.train.schedule.shares() {
        let price = |PricedCell { generator, codes, grid_cell: cell, .. }: &PricedCell, batch| {
            Price { sweep, clips, generator, codes, cell }.buys(batch)
        };
        let (kept, out) = in_step(priced, &sweep.train, price);
        dropped.extend(out);
        return (kept, dropped);
    }
    (priced, dropped)
}

fn price_cell(
    sweep: &Sweep,
    clips: &BTreeMap<ClipShape, f64>,
    cell: &GridCell,
) -> Result<PricedCell, String> {
    let tokenizer = sweep.tokenizer.spec(cell.quantizer.clone(), &sweep.text);
    let codes = tokenizer.grid();
    let context = Context {
        max_text: sweep.text.max_tokens,
        d_latent: tokenizer.architecture.code_dim(),
        frames_per_latent: tokenizer.stride(),
        corruption: sweep.model.corruption,
        text_drop: sweep.model.text_drop,
    };
    let shape = shape(&cell.model, &sweep.model, &sweep.text);
    let generator = cell.generator.of(shape, &codes, &context);
    let price = Price { sweep, clips, generator: &generator, codes: &codes, cell };
    let (spending, flops_per_token) = price.spend()?;
    let params = generator.params(&codes);
    Ok(PricedCell {
        group: None,
        pace: pace(&params, spending.tokens(), spending, &sweep.train),
        params,
        generator,
        grid_cell: cell.clone(),
        codes,
        flops_per_token,
        spending,
    })
}

/// The training that a budget buys.
struct Price<'a> {
    sweep: &'a Sweep,
    clips: &'a BTreeMap<ClipShape, f64>,
    generator: &'a GeneratorSpec,
    codes: &'a Grid,
    cell: &'a GridCell,
}

impl Price<'_> {
    /// Forward FLOPs per token in steps of a batch, and D for the budget. The exact count uses the length and text of each
    /// clip, or the longest clip if clips are unknown.
    fn buys(&self, batch_tokens: usize) -> (FlopsPerToken, f64) {
        let Self { sweep, generator, codes, clips, cell } = *self;
        let rule = sweep.flops.rule;
        let mut per_token = generator.flops_per_token(codes, sweep.text.max_tokens);
        if rule == FlopsRule::Exact && !clips.is_empty() {
            per_token.exact = exact_per_token(&**generator, codes, clips, batch_tokens);
        }
        (per_token, tokens_bought(cell.budget_flops, per_token.by(rule)))
    }

    /// Steps, and the largest batch that its rule gives for the tokens that it buys itself.
    ///
    /// Larger batches part fewer clips, so they buy more tokens, for which the rule's batch is larger: from
    /// above it comes to rest.
    fn spend(&self) -> Result<(Spending, FlopsPerToken), String> {
        let train = &self.sweep.train;
        let mut batch = train.batch.max;
        loop {
            let (per_token, tokens) = self.buys(batch);
            if tokens > MOST_TOKENS {
                let reason = "more than can be counted";
                return Err(format!("the budget buys {tokens:.1e} tokens: {reason}"));
            }
            let next = widest_batch(tokens, tokens, train);
            if next >= batch {
                return Ok((spend_with(tokens, batch, train)?, per_token));
            }
            batch = next;
        }
    }
}

// The exact cost of a supervised token, on clips of their own lengths.
//
// A step has a fixed number of supervised tokens, and a clip that straddles two steps is computed in both. So the
// price of a token depends on the length of clips relative to a step.

/// Forward FLOPs a supervised token, on average over the clips and over where steps part them.
fn exact_per_token(
    generator: &dyn Pricing,
    codes: &Grid,
    clips: &BTreeMap<ClipShape, f64>,
    batch_tokens: usize,
) -> f64 {
    let (mut flops, mut tokens) = (0.0, 0.0);
    for (clip, count) in clips {
        let places = generator.places(codes, clip.n_frames);
        let step = (batch_tokens / places.tokens_each).max(1);
        let of_part = |part| generator.exact_of_part(codes, *clip, part);
        flops += count * over_steps(places.count, step, of_part);
        tokens += count * (places.count * places.tokens_each) as f64;
    }
    flops / tokens
}

/// The sum over the parts that steps of `step` places make of a clip of `n`, on average over where in a step
/// it begins.
fn over_steps(n: usize, step: usize, of_part: impl Fn(Range<usize>) -> f64) -> f64 {
    let whole = step.saturating_add(1).saturating_sub(n) as f64;
    let parted = |first: usize| {
        let later = (first..n).step_by(step).map(|from| of_part(from..(from + step).min(n)));
        of_part(0..first) + later.sum::<f64>()
    };
    let parted: f64 = (1..=step.min(n - 1)).map(parted).sum();
    (whole * of_part(0..n) + parted) / step as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same by laying clips of `n` into steps one after another.
    fn laid_out(n: usize, step: usize, of_part: impl Fn(Range<usize>) -> f64) -> f64 {
        // After `step` clips steps and clips begin together again.
        let mut sum = 0.0;
        for clip in 0..step {
            let (start, end) = (clip * n, (clip + 1) * n);
            let mut at = start;
            while at < end {
                let to = ((at / step + 1) * step).min(end);
                sum += of_part(at - start..to - start);
                at = to;
            }
        }
        sum / step as f64
    }

    #[test]
    fn clips_are_parted_as_a_stream_of_them_is() {
        let of_part = |part: Range<usize>| 10.0 + (part.end * part.end) as f64 + part.len() as f64;
        // Clips and steps without a common divisor begin at every offset.
        for (n, step) in [(5, 32), (37, 32), (49, 8), (3, 1), (1, 7)] {
            let (found, expected) = (over_steps(n, step, of_part), laid_out(n, step, of_part));
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{n} in steps of {step}: {found}, {expected}"
            );
        }
    }
}
