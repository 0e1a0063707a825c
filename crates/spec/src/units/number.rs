//! Numbers as users write them in a sweep file: `1e18` is a whole number too.

use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error};
use serde_yaml::Value;

/// A value that is read as people write it: numbers as `512`, `1e6` or `1_000`, all else as serde has it.
pub trait Written: DeserializeOwned {
    /// Reads a number.
    ///
    /// # Errors
    /// The value found instead.
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        <Self as Deserialize<'de>>::deserialize(deserializer)
    }
}

/// [`Written::written`] as serde's attribute `deserialize_with` asks for it.
pub fn read<'de, T: Written, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::written(deserializer)
}

/// Types that are read as serde has them.
#[macro_export]
macro_rules! plain {
    ($($type:ty),* $(,)?) => { $(impl $crate::units::number::Written for $type {})* };
}
pub use plain;

plain!(bool, String, std::path::PathBuf);

impl Written for f64 {
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        of_value(&Value::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

impl Written for usize {
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        whole(&Value::deserialize(deserializer)?).map_err(D::Error::custom)
    }
}

/// A seed: any whole number.
impl Written for u64 {
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        let large = value.as_u64();
        large.map_or_else(|| whole(&value).map(|seed| seed as u64), Ok).map_err(D::Error::custom)
    }
}

/// A value of a list, so that an error has its place and not the list's.
struct One<T>(T);

impl<'de, T: Written> Deserialize<'de> for One<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        T::written(deserializer).map(Self)
    }
}

impl<T: Written> Written for Option<T> {
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Option::<One<T>>::deserialize(deserializer)?.map(|one| one.0))
    }
}

impl<T: Written> Written for Vec<T> {
    fn written<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Vec::<One<T>>::deserialize(deserializer)?.into_iter().map(|one| one.0).collect())
    }
}

/// The whole number in a value; the error names the value.
pub fn whole(value: &Value) -> Result<usize, String> {
    let number = of_value(value)?;
    if number.fract() == 0.0 && (0.0..9e15).contains(&number) {
        Ok(number as usize)
    } else {
        Err(format!("expected a whole number, found {}", shown(value)))
    }
}

/// The number in a value, as YAML or as text; the error names the value.
pub fn of_value(value: &Value) -> Result<f64, String> {
    let number = match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.replace('_', "").parse().ok(),
        _ => None,
    };
    match number {
        Some(number) if number.is_finite() => Ok(number),
        _ => Err(format!("expected a number, found {}", shown(value))),
    }
}

fn shown(value: &Value) -> String {
    match serde_yaml::to_string(value) {
        Ok(text) => format!("`{}`", text.trim()),
        Err(_) => "something else".to_string(),
    }
}

// Sections of a sweep file, of which every key may be left out.

/// A section from a list of its keys, each with its default and, for a number, its range; a key is not written
/// if it is `unless`.
#[macro_export]
macro_rules! section {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $(
                $(#[$of_key:meta])*
                $key:ident: $type:ty = $default:expr
                    $(, $low:literal to $high:literal)? $(, unless $hidden:literal)?;
            )*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        #[derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct $name {
            $(
                $(#[$of_key])*
                #[serde(deserialize_with = "crate::units::number::read")]
                $(#[serde(skip_serializing_if = $hidden)])?
                $(#[schemars(range(min = $low, max = $high))])?
                pub $key: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($key: $default,)* }
            }
        }
    };
}

/// A spec with the keys of a section, and defaults for missing keys.
#[macro_export]
macro_rules! or_default {
    ($section:expr, $default:expr, $($key:ident),*) => {{
        let mut spec = $default;
        $(spec.$key = $section.$key.unwrap_or(spec.$key);)*
        spec
    }};
}

pub use {or_default, section};

/// Whether a key has its default, which is then not written.
pub fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    #[derive(Deserialize)]
    struct Row {
        #[serde(deserialize_with = "crate::units::number::read")]
        n: usize,
        #[serde(deserialize_with = "crate::units::number::read")]
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
