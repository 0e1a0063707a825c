//! A fit in words, for a terminal.

pub(in crate::laws) mod brief;
pub(in crate::laws) mod summary;
pub(in crate::laws) mod summary_checks;
pub(in crate::laws) mod verdict;
