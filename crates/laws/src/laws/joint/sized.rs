//! What a joint law says of a model that need not be the best one for its FLOPs.

use super::weighed::valley;
use super::{JointLaw, JointLoss};
use crate::laws::minima::types::Optimum;

/// A model on some tokens, beside the best model for the same FLOPs.
#[derive(Clone, Debug, PartialEq)]
pub struct SizedLoss {
    pub flops: f64,
    pub params_vocab: f64,
    /// V, if the law or the caller tells it.
    pub n_vocab: Option<f64>,
    pub loss: f64,
    /// `None` if the law has no finite optimum there.
    pub best: Option<Optimum>,
    /// The loss, and that of the best model, by each bootstrap replicate that has both.
    pub replicates: Vec<[f64; 2]>,
}

impl JointLaw {
    /// A model of `params_nonvocab` parameters and `n_vocab` codes, trained on `tokens`.
    pub fn sized(&self, params_nonvocab: f64, n_vocab: Option<f64>, tokens: f64) -> SizedLoss {
        let v = n_vocab.unwrap_or_default();
        let params_vocab = self.cost.params_vocab(params_nonvocab, v);
        let flops = tokens / self.cost.tokens(1.0, params_nonvocab, params_vocab);
        let pair = |loss: &JointLoss| {
            let best = self.cost.optimum(loss, flops)?;
            Some((loss.at(params_nonvocab, v, tokens), best))
        };
        let replicate = |values: &Vec<f64>| {
            let (loss, best) = pair(&self.loss.with(values))?;
            Some([loss, best.loss])
        };
        SizedLoss {
            flops,
            params_vocab,
            n_vocab,
            loss: self.loss.at(params_nonvocab, v, tokens),
            best: pair(&self.loss).map(|(_, best)| best),
            replicates: self.bootstrap.iter().filter_map(replicate).collect(),
        }
    }

    /// V of a model whose vocabulary has `params_vocab` parameters.
    pub fn codes(&self, params_nonvocab: f64, params_vocab: f64) -> f64 {
        params_vocab / self.cost.params_vocab(params_nonvocab, 1.0)
    }

    /// How much a run `above` the best loss of its budget counts in the fit, 1 being the best run,
    /// if single runs scatter by `sd`.
    pub fn counts(above: f64, sd: f64) -> f64 {
        valley(above, sd)
    }
}
