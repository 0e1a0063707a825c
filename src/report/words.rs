//! What a page calls the loss and the size of a model: in a sweep, and in a table made elsewhere.

use super::input::Study;
use crate::laws::Parameters;

/// Names of quantities.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Words {
    /// The size of a model: N_nv, or N where the vocabulary's parameters are not told apart.
    pub size: &'static str,
    /// The loss in a sentence.
    pub loss: &'static str,
    /// The loss with its unit, at an axis.
    pub loss_axis: String,
    /// Whether models have a vocabulary.
    pub has_vocab: bool,
}

impl Study<'_> {
    /// What its quantities are called.
    pub fn words(&self) -> Words {
        let total = self.laws.is_some_and(|laws| laws.parameters == Parameters::Total);
        let has_vocab = !total && self.records.iter().any(|run| run.planned.n_vocab > 0);
        let size = match self.laws {
            Some(_) if total => "N",
            None if !has_vocab && !self.records.is_empty() => "N",
            _ => "N_nv",
        };
        let (loss, loss_axis) = self.loss_name.map_or(("L_u", "L_u, nats"), |name| ("loss", name));
        Words { size, loss, loss_axis: loss_axis.to_string(), has_vocab }
    }
}
