//! The circles of files that are left.

/// Files that need one another and cannot well be had apart, and why.
pub const ALLOWED: [(&[&str], &str); 1] = [(
    &["crates/model/src/ops/own/lanes.rs", "crates/model/src/ops/own/x86.rs"],
    "a macro that chooses among instruction sets, each of which has lanes",
)];
