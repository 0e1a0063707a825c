//! Laws and procedures of papers.

pub(in crate::laws) mod scamo;
pub mod tao;
