//! Conditions of `grid.exclude`: `n_vocab > 1000 and d_model < 64`.

/// Names that a condition may compare, in the order of [`Condition::holds`].
pub const FIELDS: [&str; 6] = ["n_layer", "n_head", "d_model", "n_vocab", "budget", "share"];

/// Comparisons that must all hold.
#[derive(Clone, Debug)]
pub struct Condition(Vec<Comparison>);

#[derive(Clone, Debug)]
struct Comparison {
    /// Index of one of [`FIELDS`].
    field: usize,
    holds: Holds,
    value: f64,
}

type Holds = fn(&f64, &f64) -> bool;

/// Longer operators first, so that `<=` is not read as `<`.
const OPERATORS: [(&str, Holds); 6] = [
    ("<=", f64::le),
    (">=", f64::ge),
    ("==", f64::eq),
    ("!=", f64::ne),
    ("<", f64::lt),
    (">", f64::gt),
];

impl Condition {
    /// Reads a condition; the error says what was not understood.
    pub fn parse(text: &str) -> Result<Self, String> {
        text.split(" and ").map(comparison).collect::<Result<_, _>>().map(Self)
    }

    /// Whether every comparison holds for the cell with these values of [`FIELDS`].
    pub fn holds(&self, values: [f64; FIELDS.len()]) -> bool {
        self.0.iter().all(|Comparison { field, holds, value }| holds(&values[*field], value))
    }
}

fn comparison(text: &str) -> Result<Comparison, String> {
    let split = |(operator, holds)| Some((text.split_once(operator)?, holds));
    let found = OPERATORS.into_iter().find_map(split);
    let ((field, value), holds) = found.ok_or(format!("no comparison in `{}`", text.trim()))?;
    let (field, value) = (field.trim(), value.trim());
    let unknown = || format!("unknown name `{field}`; valid: {}", FIELDS.join(", "));
    let field = FIELDS.iter().position(|name| *name == field).ok_or_else(unknown)?;
    let value = value.parse().map_err(|_| format!("`{value}` is not a number"))?;
    Ok(Comparison { field, holds, value })
}

#[cfg(test)]
mod tests {
    use super::Condition;

    #[test]
    fn every_comparison_must_hold() {
        let condition = Condition::parse("n_vocab >= 1e3 and d_model < 64").unwrap();
        let cell = |v: f64, d: f64| [d, d, d, v, d, d];
        assert!(condition.holds(cell(1000.0, 32.0)));
        assert!(!condition.holds(cell(999.0, 32.0)));
        assert!(!condition.holds(cell(1000.0, 64.0)));
    }

    #[test]
    fn what_is_not_a_condition_is_named() {
        assert!(Condition::parse("n_vocab").unwrap_err().contains("no comparison"));
        assert!(Condition::parse("width > 3").unwrap_err().contains("`width`"));
        assert!(Condition::parse("d_model > big").unwrap_err().contains("`big`"));
    }
}
