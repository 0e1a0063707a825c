//! The laws through one frontier.

use super::{Approach1Options, FrontierPoint};
use crate::laws::input::point::Parameters;
use crate::laws::lines::floor_law::floor_law;
use crate::laws::lines::log_law::log_law;
use crate::laws::lines::power::power_law;
use crate::laws::lines::types::{LossLaws, PowerLaw};
use crate::laws::maths::stats::geometric_mean;

/// The laws through one frontier; N_v's is absent where the vocabulary is.
#[derive(Clone)]
pub(super) struct Fitted {
    pub nonvocab: PowerLaw,
    pub vocab: Option<PowerLaw>,
    pub tokens: PowerLaw,
    pub vocab_from_nonvocab: Option<PowerLaw>,
    pub loss: LossLaws,
}

impl Fitted {
    /// None for fewer than three points, or where C does not vary.
    pub fn new(
        front: &[FrontierPoint],
        reference: f64,
        options: &Approach1Options,
    ) -> Option<Self> {
        if front.len() < 3 {
            return None;
        }
        let column = |of: fn(&FrontierPoint) -> f64| front.iter().map(of).collect::<Vec<f64>>();
        let (compute, ones) = (column(|p| p.flops), vec![1.0; front.len()]);
        let law = |x: &[f64], y: &[f64], at| power_law(x, y, at, &ones, options.huber);
        let (nonvocab, vocab) = (column(|p| p.params_nonvocab), column(|p| p.params_vocab));
        let split = options.parameters == Parameters::Split;
        let several = front.iter().any(|p| p.n_vocab != front[0].n_vocab);
        let told = split && several;
        let loss = column(|p| p.loss);
        Some(Self {
            nonvocab: law(&compute, &nonvocab, reference)?,
            vocab: if told { law(&compute, &vocab, reference) } else { None },
            tokens: law(&compute, &column(|p| p.tokens), reference)?,
            vocab_from_nonvocab: if told {
                law(&nonvocab, &vocab, geometric_mean(&nonvocab))
            } else {
                None
            },
            loss: LossLaws {
                log: log_law(&compute, &loss),
                floor: floor_law(&compute, &loss, reference),
            },
        })
    }
}
