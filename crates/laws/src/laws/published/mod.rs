//! Laws of papers.

pub(in crate::laws) mod scamo;
