//! Laws through minima: power laws, the loss in C, and their intervals.

pub(in crate::laws) mod bootstrap;
pub(in crate::laws) mod floor_law;
pub(in crate::laws) mod intervals;
pub(in crate::laws) mod law_set;
pub(in crate::laws) mod log_law;
pub(in crate::laws) mod power;
pub(in crate::laws) mod robust;
pub(in crate::laws) mod sample;
pub(in crate::laws) mod slices;
pub(in crate::laws) mod types;
pub(in crate::laws) mod validation;
