//! What `laws.json` holds.

pub(in crate::laws) mod advice;
pub(in crate::laws) mod answer;
pub(in crate::laws) mod difference;
pub(in crate::laws) mod judgement;
pub(in crate::laws) mod kind;
pub(in crate::laws) mod laws;
pub(in crate::laws) mod validated;
