//! Flags of minima in words.

use crate::laws::minima::types::{Minimum, MinimumFlag};
use crate::laws::words::text::count;

/// The flags in one phrase: "not-convex, vocab-edge".
pub fn flags_text(flags: &[MinimumFlag]) -> String {
    flags.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// Flagged minima named before the rest are only counted.
const MOST_NAMED: usize = 8;

/// Every flagged minimum by name: "1e10 (vocab-edge), 3e10 (not-convex)"; of many, the first.
pub(in crate::laws) fn flagged(minima: &[Minimum]) -> String {
    let flagged: Vec<&Minimum> = minima.iter().filter(|m| !m.trusted).collect();
    let name = |m: &&Minimum| format!("{} ({})", count(m.budget_flops), flags_text(&m.flags));
    let named = flagged.iter().take(MOST_NAMED).map(name).collect::<Vec<_>>().join(", ");
    match flagged.len().saturating_sub(MOST_NAMED) {
        0 => named,
        more => format!("{named} and {more} more"),
    }
}
