//! A fit in words, for a terminal.

mod brief;
mod checks;
mod full;
mod intervals;
mod parametric;
mod verdict;

pub use brief::brief;
pub use full::summary;
pub use parametric::parametric_text;
