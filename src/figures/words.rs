//! What figures call the loss and the size of a model: in a sweep, and in a table made elsewhere.

use super::Sources;
use super::quantity::{Quantity, quantities};
use crate::laws::Parameters;

/// Series that a legend can list.
const MOST_SERIES: usize = 100;

/// An error where there are more `things` than a legend can list.
pub fn few_enough(count: usize, things: &str) -> Result<(), String> {
    match count > MOST_SERIES {
        true => Err(format!("{count} {things} are too many to tell apart")),
        false => Ok(()),
    }
}

impl Sources<'_> {
    /// The axis of the loss.
    pub fn loss_axis(&self) -> String {
        match self.input.loss_name {
            None => "Normalised loss Lᵤ (nats)".to_owned(),
            Some("loss") => "Loss".to_owned(),
            Some(name) => format!("Loss: {name}"),
        }
    }

    /// The symbol of the loss, and its unit after a number.
    pub fn loss_symbol(&self) -> [&'static str; 2] {
        if self.input.loss_name.is_none() { ["Lᵤ", " nats"] } else { ["L", ""] }
    }

    /// Whether the vocabulary's parameters are not told apart.
    pub fn knows_size_alone(&self) -> bool {
        match self.input.laws {
            Some(laws) => laws.parameters == Parameters::Total,
            None => self.input.records.iter().all(|run| run.planned.params_vocab == 0),
        }
    }

    /// An error where there is no vocabulary to show.
    pub fn needs_vocabulary(&self) -> Result<(), String> {
        match self.knows_size_alone() && self.input.loss_name.is_some() {
            true => Err("the vocabulary's parameters are not told apart".to_owned()),
            false => Ok(()),
        }
    }

    /// The symbol of a model's size.
    pub fn size_symbol(&self) -> &'static str {
        if self.knows_size_alone() { "N" } else { "Nₙᵥ" }
    }

    /// The quantities of the optimum that laws are of, the model's size first.
    pub fn quantities(&self) -> Vec<&'static Quantity> {
        quantities(self.knows_size_alone())
    }
}
