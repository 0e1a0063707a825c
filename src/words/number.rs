//! Numbers that may be missing, and intervals.

/// A number; a dash if there is none.
pub fn known(x: Option<f64>, number: impl Fn(f64) -> String) -> String {
    x.map_or_else(|| "-".into(), number)
}

/// An interval in a column of a table; a dash if there is none.
pub fn span(ends: Option<[f64; 2]>, number: impl Fn(f64) -> String) -> String {
    ends.map_or_else(|| "-".into(), |[low, high]| format!("{}..{}", number(low), number(high)))
}

/// An interval in a sentence.
pub fn from_to(ends: [f64; 2], number: impl Fn(f64) -> String) -> String {
    let [low, high] = ends.map(number);
    format!("{low} to {high}")
}

/// Three decimals.
pub fn thousandths(x: f64) -> String {
    format!("{x:.3}")
}

/// Four decimals.
pub fn four(x: f64) -> String {
    format!("{x:.4}")
}
