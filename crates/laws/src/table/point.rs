//! One row of derived quantities into a point, if all of its logarithms exist.

use super::columns::Named;
use super::derive::{Derived, size};
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
    /// One quantity, a value a row.
    pub fn of(&self, quantity: Quantity) -> &[f64] {
        let own = self.columns.iter().find(|(own, _)| *own == quantity);
        own.map_or(&[], |(_, values)| values)
    }

    /// Every value of a row by the quantity that it is.
    pub fn values(&self, row: usize) -> impl Iterator<Item = (Quantity, f64)> {
        self.columns.iter().map(move |(quantity, values)| (*quantity, values[row]))
    }

    /// The point of a row whose logarithms all exist.
    pub fn checked(&self, row: usize, named: &Named) -> Result<IsoFlopPoint, TableError> {
        let run_id = &named.run_ids[row];
        for (quantity, value) in self.values(row) {
            if let Some(expected) = self.rejects(quantity, value) {
                let source_of = source(named, quantity);
                let run_id = run_id.clone();
                return Err(TableError::BadValue { run_id, source_of, value, expected });
            }
        }
        let at = |quantity| self.of(quantity)[row];
        let known = |quantity| Some(at(quantity)).filter(|value| !value.is_nan());
        Ok(IsoFlopPoint {
            run_id: run_id.clone(),
            seed: at(Quantity::Seed) as u64,
            budget_flops: at(Quantity::BudgetFlops),
            flops: at(Quantity::Flops),
            params_nonvocab: at(size(self.parameters)),
            params_vocab: at(Quantity::ParamsVocab),
            n_vocab: at(Quantity::NVocab),
            tokens: at(Quantity::Tokens),
            metric: self.metric.clone(),
            loss: at(Quantity::Loss),
            weight: at(Quantity::Weight),
            about: RunFacts {
                share: known(Quantity::Share),
                unique_tokens: known(Quantity::UniqueTokens),
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
