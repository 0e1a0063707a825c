//! From a budget to tokens, steps, batch, learning rate and warm-up.

use crate::spec::ParamCounts;
use crate::spec::flops::TRAINING_PER_FORWARD;
use crate::sweep::{BatchRule, LrRule, RateParams, TrainSection};

/// How one run spends its budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spending {
    /// Supervised tokens in a step.
    pub batch_tokens: usize,
    pub steps: usize,
    /// FLOPs spent over FLOPs declared.
    pub achieved_ratio: f64,
}

impl Spending {
    /// D, all supervised tokens of the run.
    pub fn tokens(self) -> usize {
        self.steps * self.batch_tokens
    }
}

/// Tokens beyond which counts of them are not exact any more.
pub const MOST_TOKENS: f64 = 9e15;

/// How far a run may miss its budget.
pub const BUDGET_TOLERANCE: f64 = 0.01;

/// D that a budget buys, before whole steps are made of it.
pub fn tokens_bought(budget: f64, flops_per_token: f64) -> f64 {
    budget / (TRAINING_PER_FORWARD * flops_per_token)
}

/// The batch of the rule for `tokens`; while it leaves `fewest` tokens fewer than `min_steps`, halved,
/// or less by a step of the rule.
pub fn widest_batch(tokens: f64, fewest: f64, train: &TrainSection) -> usize {
    let rule = &train.batch;
    let mut batch = batch_by_rule(tokens, rule);
    let less = |batch: usize| rule.multiple_of.map_or(batch / 2, |step| batch.saturating_sub(step));
    while fewest / (batch as f64) < train.min_steps as f64 && less(batch) >= rule.min {
        batch = less(batch);
    }
    batch
}

/// Whole steps of a batch that meet a number of tokens; the error is a sentence that says why none do.
pub fn spend_with(
    tokens: f64,
    batch_tokens: usize,
    train: &TrainSection,
) -> Result<Spending, String> {
    let steps = (tokens / batch_tokens as f64).round() as usize;
    if steps < train.min_steps {
        return Err(format!(
            "the budget buys {tokens:.0} tokens, {steps} steps of {batch_tokens}: fewer than \
             train.min_steps = {}",
            train.min_steps
        ));
    }
    let achieved_ratio = (steps * batch_tokens) as f64 / tokens;
    if (achieved_ratio - 1.0).abs() > BUDGET_TOLERANCE {
        return Err(format!(
            "{steps} whole steps of {batch_tokens} tokens miss the budget by {:.1} %",
            100.0 * (achieved_ratio - 1.0)
        ));
    }
    Ok(Spending { batch_tokens, steps, achieved_ratio })
}

/// How fast a run learns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// The peak learning rate.
    pub lr: f64,
    pub warmup_steps: usize,
}

/// The rate by its rule for N and D; the warm-up of a run that spends so.
pub fn pace(params: &ParamCounts, tokens: usize, spending: Spending, train: &TrainSection) -> Pace {
    let trained = params.nonvocab + params.vocab;
    Pace {
        lr: learning_rate(params, tokens, &train.lr),
        warmup_steps: warmup_steps(spending, trained, train.schedule.warmup),
    }
}

/// The power of two, or the multiple of the rule's step, nearest to c·D^p within the rule's bounds.
fn batch_by_rule(tokens: f64, rule: &BatchRule) -> usize {
    let wanted = (rule.coefficient * tokens.powf(rule.tokens_exponent)).max(1.0);
    let rounded = match rule.multiple_of {
        Some(step) => (wanted / step as f64).round() as usize * step,
        None => 2f64.powi(wanted.log2().round() as i32) as usize,
    };
    rounded.clamp(rule.min, rule.max)
}

/// lr = c·N^p·D^q, at most the rule's maximum.
pub fn learning_rate(params: &ParamCounts, tokens: usize, rule: &LrRule) -> f64 {
    let counted = match rule.params {
        RateParams::Nonvocab => params.nonvocab,
        RateParams::Total => params.nonvocab + params.vocab,
    };
    let by_params = (counted as f64).powf(rule.params_exponent);
    let by_tokens = (tokens as f64).powf(rule.tokens_exponent);
    (rule.coefficient * by_params * by_tokens).min(rule.max)
}

/// Warm-up steps: the declared share, and at most one token a parameter.
///
/// A warm-up that is long for a small model biases the exponents (Porian et al. 2024).
fn warmup_steps(spending: Spending, params: usize, share: f64) -> usize {
    let by_share = share * spending.steps as f64;
    let by_params = params as f64 / spending.batch_tokens as f64;
    by_share.min(by_params).floor() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn spending_meets_the_tokens_or_says_why_not(
            log_tokens in 1.0..12.0f64, finely in any::<bool>(),
        ) {
            let tokens = 10f64.powf(log_tokens);
            let mut train = TrainSection::default();
            train.batch.multiple_of = finely.then_some(16);
            match spend_with(tokens, widest_batch(tokens, tokens, &train), &train) {
                Ok(found) => {
                    let ratio = found.tokens() as f64 / tokens;
                    prop_assert!((ratio - 1.0).abs() <= BUDGET_TOLERANCE);
                    prop_assert!((ratio - found.achieved_ratio).abs() < 1e-9);
                    prop_assert!(found.steps >= train.min_steps);
                    let batch = found.batch_tokens;
                    let rounded = train.batch.multiple_of.map_or(batch.is_power_of_two(), |step| {
                        batch.is_multiple_of(step)
                    });
                    prop_assert!(rounded, "{} tokens a step", batch);
                }
                Err(reason) => prop_assert!(tokens
                    < (train.min_steps * train.batch.min) as f64 * 1.01, "{reason}"),
            }
        }
    }

    #[test]
    fn a_batch_of_multiples_lies_nearest_to_its_rule_as_far_as_there_are_steps() {
        let batch = |tokens: f64, multiple_of: Option<usize>, min_steps: usize| {
            let rule = BatchRule { min: 32, multiple_of, ..BatchRule::default() };
            let train = TrainSection { batch: rule, min_steps, ..TrainSection::default() };
            widest_batch(tokens, tokens, &train)
        };
        // 0.35 · √250,000 = 175; 250,000 tokens are 2,000 steps of 125.
        assert_eq!([None, Some(16)].map(|of| batch(250_000.0, of, 1)), [128, 176]);
        assert_eq!([None, Some(16)].map(|of| batch(250_000.0, of, 2000)), [64, 112]);
    }

    #[test]
    fn warm_up_takes_at_most_one_token_a_parameter() {
        let spending = Spending { batch_tokens: 100, steps: 1000, achieved_ratio: 1.0 };
        assert_eq!(warmup_steps(spending, 1_000_000, 0.1), 100);
        assert_eq!(warmup_steps(spending, 2_500, 0.1), 25);
    }
}
