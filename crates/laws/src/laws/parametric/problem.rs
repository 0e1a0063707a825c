//! An objective in the parameters that are free to move.

use super::objective::{Evaluation, Objective};
use super::vector::{MAX_PARAMS, Vector};

/// Which free parameter each parameter of a form follows; none where it is frozen.
pub(super) type Slots = [Option<usize>; MAX_PARAMS];

/// An objective with some parameters frozen and some tied to move together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem<'a> {
    pub objective: Objective<'a>,
    slots: Slots,
    /// Values of the frozen ones.
    base: Vector,
    pub n_free: usize,
}

impl<'a> Problem<'a> {
    /// Parameters of equal slots move together; the slots need not be consecutive.
    pub fn new(objective: Objective<'a>, slots: Slots, base: Vector) -> Self {
        let mut used: Vec<usize> = slots.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        let renumbered = slots.map(|slot| slot.and_then(|s| used.binary_search(&s).ok()));
        Self { objective, slots: renumbered, base, n_free: used.len() }
    }

    /// All parameters, from the free ones.
    pub fn full(&self, free: &Vector) -> Vector {
        std::array::from_fn(|p| self.slots[p].map_or(self.base[p], |slot| free[slot]))
    }

    /// The free parameters at some values of all; tied ones should agree there.
    pub fn free(&self, full: &Vector) -> Vector {
        let mut free = [0.0; MAX_PARAMS];
        for (slot, value) in self.slots.iter().zip(full) {
            if let Some(slot) = slot {
                free[*slot] = *value;
            }
        }
        free
    }

    /// Value, gradient and Hessian in the free parameters.
    pub fn evaluate(&self, free: &Vector) -> Evaluation {
        let full = self.objective.evaluate(&self.full(free));
        let mut reduced = Evaluation {
            value: full.value,
            gradient: [0.0; MAX_PARAMS],
            hessian: [[0.0; MAX_PARAMS]; MAX_PARAMS],
        };
        for (p, row) in self.slots.iter().enumerate() {
            let Some(row) = row else { continue };
            reduced.gradient[*row] += full.gradient[p];
            for (q, column) in self.slots.iter().enumerate() {
                let Some(column) = column else { continue };
                reduced.hessian[*row][*column] += full.hessian[p][q];
            }
        }
        reduced
    }
}
