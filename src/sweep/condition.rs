//! Conditions of `grid.exclude`: `n_vocab > 1000 and d_model < 64`.

/// Names that a condition may compare.
pub const FIELDS: [&str; 6] = ["n_layer", "n_head", "d_model", "n_vocab", "budget", "share"];

/// Comparisons that must all hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Condition(Vec<Comparison>);

#[derive(Clone, Debug, PartialEq)]
struct Comparison {
    field: String,
    operator: &'static str,
    value: f64,
}

/// Longer operators first, so that `<=` is not read as `<`.
const OPERATORS: [&str; 6] = ["<=", ">=", "==", "!=", "<", ">"];

impl Condition {
    /// Reads a condition; the error says what was not understood.
    pub fn parse(text: &str) -> Result<Self, String> {
        text.split(" and ").map(comparison).collect::<Result<_, _>>().map(Self)
    }

    /// Whether every comparison holds for the cell whose fields `value_of` gives.
    pub fn holds(&self, value_of: impl Fn(&str) -> f64) -> bool {
        self.0.iter().all(|c| compare(value_of(&c.field), c.operator, c.value))
    }
}

fn comparison(text: &str) -> Result<Comparison, String> {
    let operator = OPERATORS.into_iter().find(|operator| text.contains(operator));
    let operator = operator.ok_or(format!("no comparison in `{}`", text.trim()))?;
    let (field, value) = text.split_once(operator).expect("the operator was found");
    let field = field.trim().to_string();
    if !FIELDS.contains(&field.as_str()) {
        return Err(format!("unknown name `{field}`; valid: {}", FIELDS.join(", ")));
    }
    let value = value.trim();
    let value = value.parse().map_err(|_| format!("`{value}` is not a number"))?;
    Ok(Comparison { field, operator, value })
}

fn compare(left: f64, operator: &str, right: f64) -> bool {
    match operator {
        "<=" => left <= right,
        ">=" => left >= right,
        "==" => left == right,
        "!=" => left != right,
        "<" => left < right,
        _ => left > right,
    }
}

#[cfg(test)]
mod tests {
    use super::Condition;

    #[test]
    fn every_comparison_must_hold() {
        let condition = Condition::parse("n_vocab >= 1e3 and d_model < 64").unwrap();
        let cell = |v: f64, d: f64| move |field: &str| if field == "n_vocab" { v } else { d };
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
