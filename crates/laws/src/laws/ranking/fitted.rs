//! Laws through the first budgets of a sweep, and what they say of a later one.

use super::recommended::Candidate;
use crate::laws::input::options::FitOptions;
use crate::laws::joint::law::JointLaw;
use crate::laws::lines::floor_law::floor_law;
use crate::laws::lines::law_set::{Columns, LawSet, law_set};
use crate::laws::lines::types::FloorLaw;
use crate::laws::maths::stats::geometric_mean;
use crate::laws::minima::grid::Grid;
use crate::laws::minima::types::Minimum;
use crate::laws::parametric::optimum::Optimum;

/// Power laws through minima.
pub struct Lines {
    set: LawSet,
    /// The law of the loss; none where it is the log law of the set.
    floor: Option<FloorLaw>,
    reference: f64,
}

/// A law through the first budgets of a sweep.
pub enum Fitted {
    Lines(Box<Lines>),
    Joint(Box<JointLaw>),
}

impl Fitted {
    /// Of the budget of some runs; a joint law for the distinct tokens that they had.
    pub fn at(&self, grid: &Grid) -> Option<Optimum> {
        let budget = grid.budget_flops;
        match self {
            Self::Joint(joint) => on_data_of(grid, joint).optimum(budget).map(|best| Optimum {
                loss: best.loss,
                params_nonvocab: best.params_nonvocab,
                params_vocab: best.params_vocab,
                tokens: best.tokens,
            }),
            Self::Lines(lines) => Some(lines.at(budget)),
        }
    }
}

/// A joint law where the distinct tokens are those of some runs.
fn on_data_of(grid: &Grid, joint: &JointLaw) -> JointLaw {
    grid.best().unique_tokens.map_or_else(|| joint.clone(), |unique| joint.on_data(unique))
}

impl Lines {
    /// Through some minima, by the log law or the law with a floor.
    pub fn through(
        used: &[Minimum],
        law: Candidate,
        (grids, options): (&[Grid], &FitOptions),
    ) -> Option<Self> {
        let columns = Columns::new(used, grids, options);
        let reference = geometric_mean(&columns.compute);
        let set = law_set(&columns, reference, options)?;
        let floor = match law {
            Candidate::Log => None,
            _ => Some(floor_law(&columns.compute, &columns.loss, reference)?),
        };
        Some(Self { set, floor, reference })
    }

    fn at(&self, budget: f64) -> Optimum {
        let Self { set, floor, reference } = self;
        Optimum {
            loss: match floor {
                Some(floor) => floor.loss_at(budget, *reference),
                None => set.loss.loss_at(budget),
            },
            params_nonvocab: set.params_nonvocab.value_at(budget),
            params_vocab: set.params_vocab.as_ref().map_or(0.0, |law| law.value_at(budget)),
            tokens: set.tokens.value_at(budget),
        }
    }
}
