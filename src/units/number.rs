//! Numbers as people write them in a sweep file: `1e18` is a whole number too.

use serde::de::{Deserialize, Deserializer, Error};

/// A whole number, written `512`, `1e6` or `1_000`.
pub fn count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
    Count::deserialize(deserializer).map(|count| count.0)
}

/// A seed, written as a whole number.
pub fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    count(deserializer).map(|seed| seed as u64)
}

/// A list of whole numbers.
pub fn counts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<usize>, D::Error> {
    Ok(Vec::<Count>::deserialize(deserializer)?.into_iter().map(|count| count.0).collect())
}

/// A whole number that may be left out.
pub fn optional_count<'de, D: Deserializer<'de>>(d: D) -> Result<Option<usize>, D::Error> {
    Ok(Option::<Count>::deserialize(d)?.map(|count| count.0))
}

/// A number, written `1e18`, `0.1` or `1_000`.
pub fn number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Number::deserialize(deserializer).map(|number| number.0)
}

/// A number that may be left out.
pub fn optional_number<'de, D: Deserializer<'de>>(d: D) -> Result<Option<f64>, D::Error> {
    Ok(Option::<Number>::deserialize(d)?.map(|number| number.0))
}

/// A seed that may be left out.
pub fn optional_seed<'de, D: Deserializer<'de>>(d: D) -> Result<Option<u64>, D::Error> {
    Ok(Option::<Count>::deserialize(d)?.map(|count| count.0 as u64))
}

/// A list of numbers.
pub fn numbers<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    Ok(Vec::<Number>::deserialize(deserializer)?.into_iter().map(|number| number.0).collect())
}

/// A number as one value of a list, so that an error has the value's place and not the list's.
struct Number(f64);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_yaml::Value::deserialize(deserializer)?;
        of_value(&value).map(Self).map_err(D::Error::custom)
    }
}

/// A whole number as one value of a list.
struct Count(usize);

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_yaml::Value::deserialize(deserializer)?;
        whole(value).map(Self).map_err(D::Error::custom)
    }
}

/// The whole number that a value holds; the error says what it holds instead.
pub fn whole(value: serde_yaml::Value) -> Result<usize, String> {
    let number = of_value(&value)?;
    if number.fract() == 0.0 && (0.0..9e15).contains(&number) {
        Ok(number as usize)
    } else {
        Err(format!("expected a whole number, found {}", shown(&value)))
    }
}

/// The number that a value holds, as YAML or as text; the error says what it holds instead.
pub fn of_value(value: &serde_yaml::Value) -> Result<f64, String> {
    let number = match value {
        serde_yaml::Value::Number(number) => number.as_f64(),
        serde_yaml::Value::String(text) => text.replace('_', "").parse().ok(),
        _ => None,
    };
    match number {
        Some(number) if number.is_finite() => Ok(number),
        _ => Err(format!("expected a number, found {}", shown(value))),
    }
}

fn shown(value: &serde_yaml::Value) -> String {
    match serde_yaml::to_string(value) {
        Ok(text) => format!("`{}`", text.trim()),
        Err(_) => "something else".to_string(),
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Row {
        #[serde(deserialize_with = "crate::units::number::count")]
        n: usize,
        #[serde(deserialize_with = "crate::units::number::numbers")]
        c: Vec<f64>,
    }

    #[test]
    fn exponents_and_underscores_are_numbers() {
        let row: Row = serde_yaml::from_str("{n: 1e3, c: [1e18, 3E10, 1_000, 0.5]}").unwrap();
        assert_eq!((row.n, row.c), (1000, vec![1e18, 3e10, 1000.0, 0.5]));
    }

    #[test]
    fn half_a_layer_is_refused() {
        let error = serde_yaml::from_str::<Row>("{n: 1.5, c: []}").err().unwrap();
        assert!(error.to_string().contains("whole number"), "{error}");
    }
}
