//! The three quantities of ScaMo Eq. 9: N_nv, N_v and D of the optimum.

use crate::laws::{Answer, Coefficient, Exponent, Minimum, OptimumAt};

/// One of the three quantities of ScaMo Eq. 9.
pub struct Quantity {
    pub label: &'static str,
    /// The law with its symbols.
    pub form: &'static str,
    /// The exponent's symbol.
    pub exponent: &'static str,
    pub of: fn(&Minimum) -> f64,
    /// Its symbol in what the law to believe says.
    symbol: &'static str,
}

static QUANTITIES: [Quantity; 3] = [
    Quantity {
        label: "Non-vocabulary parameters Nₙᵥ",
        form: "Nₙᵥ ∝ Cᵇ",
        exponent: "b",
        of: |minimum| minimum.params_nonvocab,
        symbol: "N_nv",
    },
    Quantity {
        label: "Vocabulary parameters Nᵥ",
        form: "Nᵥ ∝ Cᵃ",
        exponent: "a",
        of: |minimum| minimum.params_vocab,
        symbol: "N_v",
    },
    Quantity {
        label: "Training tokens D",
        form: "D ∝ Cᶜ",
        exponent: "c",
        of: |minimum| minimum.tokens,
        symbol: "D",
    },
];

/// The quantities of the optimum: N and D where the vocabulary's parameters are not told apart.
pub fn quantities(size_alone: bool) -> Vec<&'static Quantity> {
    match size_alone {
        true => vec![&SIZE, &QUANTITIES[2]],
        false => QUANTITIES.iter().collect(),
    }
}

/// N, where the vocabulary's parameters are not told apart.
static SIZE: Quantity = Quantity {
    label: "Model size N (parameters)",
    form: "N ∝ Cᵃ",
    exponent: "a",
    of: |minimum| minimum.params_nonvocab,
    symbol: "N",
};

impl Quantity {
    /// Its exponent, where it is determined.
    pub fn exponent_of<'a>(&self, answer: &'a Answer) -> Option<&'a Exponent> {
        answer.exponents.of(self.symbol).filter(|own| own.value.is_some())
    }

    /// C, the value there and its 95 % interval along the fitted budgets; empty where the exponent is not
    /// determined.
    pub fn path(&self, answer: &Answer) -> Vec<(f64, Coefficient)> {
        let told = self.exponent_of(answer).is_some();
        let at = |optimum: &OptimumAt| Some((optimum.budget_flops, *optimum.at.of(self.symbol)?));
        answer.path.iter().filter(|_| told).filter_map(at).collect()
    }
}
