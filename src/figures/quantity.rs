//! The three quantities of ScaMo Eq. 9: N_nv, N_v and D of the optimum.

use crate::laws::{LawSample, Laws, Minimum, PowerLaw};

use super::fitted::interval95;

/// One of the three quantities of ScaMo Eq. 9.
pub struct Quantity {
    pub label: &'static str,
    /// The law with its symbols.
    pub form: &'static str,
    /// The exponent's symbol.
    pub exponent: &'static str,
    pub of: fn(&Minimum) -> f64,
    pub law: fn(&Laws) -> Option<&PowerLaw>,
    /// ln of the quantity at C0, and its exponent, in one bootstrap replicate.
    sample: fn(&LawSample) -> (f64, f64),
}

pub static QUANTITIES: [Quantity; 3] = [
    Quantity {
        label: "Non-vocabulary parameters Nₙᵥ",
        form: "Nₙᵥ ∝ Cᵇ",
        exponent: "b",
        of: |minimum| minimum.params_nonvocab,
        law: |laws| laws.power_laws.params_nonvocab.as_ref(),
        sample: |sample| (sample.ln_nonvocab_at_reference, sample.exponent_nonvocab),
    },
    Quantity {
        label: "Vocabulary parameters Nᵥ",
        form: "Nᵥ ∝ Cᵃ",
        exponent: "a",
        of: |minimum| minimum.params_vocab,
        law: |laws| laws.power_laws.params_vocab.as_ref(),
        sample: |sample| (sample.ln_vocab_at_reference, sample.exponent_vocab),
    },
    Quantity {
        label: "Training tokens D",
        form: "D ∝ Cᶜ",
        exponent: "c",
        of: |minimum| minimum.tokens,
        law: |laws| laws.power_laws.tokens.as_ref(),
        sample: |sample| (sample.ln_tokens_at_reference, sample.exponent_tokens),
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
    law: |laws| laws.power_laws.params.as_ref(),
    sample: |sample| (sample.ln_nonvocab_at_reference, sample.exponent_nonvocab),
};

impl Quantity {
    /// Its 95 % interval at C, from the bootstrap.
    pub fn interval(&self, laws: &Laws, flops: f64) -> (f64, f64) {
        let ln_ratio = (flops / laws.reference_flops).ln();
        interval95(&laws.bootstrap, |sample| {
            let (ln_at_reference, exponent) = (self.sample)(sample);
            (ln_at_reference + exponent * ln_ratio).exp()
        })
    }
}
