//! The three quantities of ScaMo Eq. 9: N_nv, N_v and D of the optimum.

use crate::laws::{Answer, Coefficient, Exponent, Minimum, OptimumAt, OwnExponents};

/// One of the three quantities of ScaMo Eq. 9.
pub struct Quantity {
    pub label: &'static str,
    /// The law with its symbols.
    pub form: &'static str,
    /// The exponent's symbol.
    pub exponent: &'static str,
    pub of: fn(&Minimum) -> f64,
    /// Of the law to believe.
    at: fn(&OptimumAt) -> Option<Coefficient>,
    told: fn(&OwnExponents) -> Option<&Exponent>,
}

pub static QUANTITIES: [Quantity; 3] = [
    Quantity {
        label: "Non-vocabulary parameters Nₙᵥ",
        form: "Nₙᵥ ∝ Cᵇ",
        exponent: "b",
        of: |minimum| minimum.params_nonvocab,
        at: |optimum| optimum.params_nonvocab.or(optimum.params),
        told: |own| own.params_nonvocab.as_ref().or(own.params.as_ref()),
    },
    Quantity {
        label: "Vocabulary parameters Nᵥ",
        form: "Nᵥ ∝ Cᵃ",
        exponent: "a",
        of: |minimum| minimum.params_vocab,
        at: |optimum| optimum.params_vocab,
        told: |own| own.params_vocab.as_ref(),
    },
    Quantity {
        label: "Training tokens D",
        form: "D ∝ Cᶜ",
        exponent: "c",
        of: |minimum| minimum.tokens,
        at: |optimum| optimum.tokens,
        told: |own| own.tokens.as_ref(),
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
pub static SIZE: Quantity = Quantity {
    label: "Model size N (parameters)",
    form: "N ∝ Cᵃ",
    exponent: "a",
    of: |minimum| minimum.params_nonvocab,
    at: |optimum| optimum.params,
    told: |own| own.params.as_ref(),
};

impl Quantity {
    /// Its exponent, where it is determined.
    pub fn exponent_of<'a>(&self, answer: &'a Answer) -> Option<&'a Exponent> {
        (self.told)(&answer.exponents).filter(|own| own.value.is_some())
    }

    /// C, the value there and its 95 % interval along the fitted budgets; empty where the exponent is not
    /// determined.
    pub fn path(&self, answer: &Answer) -> Vec<(f64, Coefficient)> {
        let told = self.exponent_of(answer).is_some();
        let at = |optimum: &OptimumAt| Some((optimum.budget_flops, (self.at)(optimum)?));
        answer.path.iter().filter(|_| told).filter_map(at).collect()
    }
}
