//! One row of derived quantities into a point, if all of its logarithms exist.

use super::columns::Named;
use super::derive::Derived;
use super::{Quantity, TableError};
use crate::laws::{IsoFlopPoint, Parameters, RunFacts};

/// The largest whole number below which a float holds every one.
const LARGEST_SEED: f64 = 9_007_199_254_740_992.0;

/// "tokens", with the column or expression that gives it where that is another name.
pub(super) fn source(named: &Named, quantity: Quantity) -> String {
    match named.sources.get(&quantity) {
        Some(text) if text != quantity.name() => format!("{quantity} (`{text}`)"),
        Some(_) => quantity.to_string(),
        None => format!("{quantity} (derived)"),
    }
}

impl Derived {
    /// Every value that a row needs, by the quantity that it is.
    pub fn values(&self, row: usize) -> [(Quantity, f64); 9] {
        let total = self.parameters == Parameters::Total;
        let params = if total { Quantity::Params } else { Quantity::ParamsNonvocab };
        [
            (Quantity::Loss, self.loss[row]),
            (params, self.params_nonvocab[row]),
            (Quantity::ParamsVocab, self.params_vocab[row]),
            (Quantity::NVocab, self.n_vocab[row]),
            (Quantity::Tokens, self.tokens[row]),
            (Quantity::BudgetFlops, self.budget_flops[row]),
            (Quantity::Flops, self.flops[row]),
            (Quantity::Seed, self.seed[row]),
            (Quantity::Weight, self.weight[row]),
        ]
    }

    /// What a row may leave out: NaN there.
    fn optional(&self, row: usize) -> [(Quantity, f64); 2] {
        [(Quantity::Share, self.share[row]), (Quantity::UniqueTokens, self.unique_tokens[row])]
    }

    /// The point of a row whose logarithms all exist.
    pub fn checked(&self, row: usize, named: &Named) -> Result<IsoFlopPoint, TableError> {
        let run_id = &named.run_ids[row];
        for (quantity, value) in self.values(row).into_iter().chain(self.optional(row)) {
            if let Some(expected) = self.rejects(quantity, value) {
                let source_of = source(named, quantity);
                let run_id = run_id.clone();
                return Err(TableError::BadValue { run_id, source_of, value, expected });
            }
        }
        Ok(IsoFlopPoint {
            run_id: run_id.clone(),
            seed: self.seed[row] as u64,
            budget_flops: self.budget_flops[row],
            flops: self.flops[row],
            params_nonvocab: self.params_nonvocab[row],
            params_vocab: self.params_vocab[row],
            n_vocab: self.n_vocab[row],
            tokens: self.tokens[row],
            metric: self.metric.clone(),
            loss: self.loss[row],
            weight: self.weight[row],
            about: RunFacts {
                share: Some(self.share[row]).filter(|share| !share.is_nan()),
                unique_tokens: Some(self.unique_tokens[row]).filter(|n| !n.is_nan()),
                ..RunFacts::default()
            },
        })
    }

    /// What the value would have to be; none where it will do.
    fn rejects(&self, quantity: Quantity, value: f64) -> Option<&'static str> {
        let unknown = match quantity {
            Quantity::ParamsVocab | Quantity::NVocab => self.parameters == Parameters::Total,
            // A row that does not say saw all of the data.
            Quantity::Share | Quantity::UniqueTokens => value.is_nan(),
            _ => false,
        };
        let is_seed = (0.0..=LARGEST_SEED).contains(&value) && value.fract() == 0.0;
        match quantity {
            _ if unknown => None,
            Quantity::Loss => (!value.is_finite()).then_some("finite"),
            Quantity::Seed => (!is_seed).then_some("a whole number from 0"),
            _ => (!(value.is_finite() && value > 0.0)).then_some("finite and above 0"),
        }
    }
}
