//! Laws through the first budgets of a sweep, and what they say of a later one.

use super::recommended::Candidate;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::law_set::LawSet;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::types::Optimum;

/// A law through the first budgets of a sweep.
pub enum Fitted {
    /// By the log law of the loss, or the law with a floor.
    Lines(Box<LawSet>, Candidate),
    Joint(Box<JointLaw>),
}

impl Fitted {
    /// Of the budget of some runs; a joint law for the distinct tokens that they had.
    pub fn at(&self, grid: &Grid) -> Option<Optimum> {
        let budget = grid.budget_flops;
        match self {
            Self::Joint(joint) => on_data_of(grid, joint).optimum(budget),
            Self::Lines(set, law) => of_lines(set, *law, budget),
        }
    }
}

/// A joint law where the distinct tokens are those of some runs.
fn on_data_of(grid: &Grid, joint: &JointLaw) -> JointLaw {
    grid.best().unique_tokens.map_or_else(|| joint.clone(), |unique| joint.on_data(unique))
}

/// The optimum by laws through minima; None if there is no such law of the loss.
fn of_lines(set: &LawSet, law: Candidate, budget: f64) -> Option<Optimum> {
    let by_floor = || Some(set.floor.as_ref()?.loss_at(budget, set.reference));
    Some(Optimum {
        loss: if law == Candidate::Log { set.log.loss_at(budget) } else { by_floor()? },
        params_nonvocab: set.params_nonvocab.value_at(budget),
        params_vocab: set.params_vocab.as_ref().map_or(0.0, |law| law.value_at(budget)),
        n_vocab: None,
        tokens: set.tokens.value_at(budget),
    })
}
