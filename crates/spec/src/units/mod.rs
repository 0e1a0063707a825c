//! Numbers and amounts of memory as people write them.
//!
//! # Example
//!
//! ```
//! assert_eq!(isoflop_spec::units::parse_bytes("24 GiB"), Ok(24 << 30));
//! ```

pub mod number;
pub mod ranges;

use std::fmt;
use std::marker::PhantomData;

pub use number::{is_default, or_default, section};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{DeserializeOwned, Deserializer, Error, MapAccess, SeqAccess, Unexpected, Visitor};
use serde_yaml::Value;

// Amounts of memory.

/// Bytes from `8GB`, `512MiB`, `2e9`: decimal and binary units.
///
/// # Errors
/// A sentence with the accepted forms.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let trimmed = text.trim();
    let unit = trimmed.trim_start_matches(|c: char| c.is_ascii_digit() || "._+-".contains(c));
    // `2e9` is a number, `2EB` is not asked for.
    let (number, unit) = match trimmed.parse::<f64>() {
        Ok(_) => (trimmed, ""),
        Err(_) => (&trimmed[..trimmed.len() - unit.len()], unit.trim()),
    };
    let factor = match unit.to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kb" => 1e3,
        "m" | "mb" => 1e6,
        "g" | "gb" => 1e9,
        "t" | "tb" => 1e12,
        "kib" => 1024.0,
        "mib" => 1024f64.powi(2),
        "gib" => 1024f64.powi(3),
        "tib" => 1024f64.powi(4),
        _ => return Err(format!("`{unit}` is no unit of memory: MB, GB, MiB, GiB")),
    };
    match number.parse::<f64>() {
        Ok(n) if n > 0.0 && n.is_finite() => Ok((n * factor) as u64),
        _ => Err(format!("{text} is no amount of memory, as 8GB")),
    }
}

// Words as a shell reads them.

/// A word as a POSIX shell reads it.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_string();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

// [`Ways`]: entries with several notations, distinguished by their YAML kind.
//
// serde's untagged enums would do the same, but lose the place in the file and the error of each notation; these
// keep both.

/// An entry by the ways to write it, each `None` if it is none of this entry's.
pub trait Ways: Sized {
    /// The accepted notations.
    const EXPECTED: &'static str;

    /// A number or a text.
    fn of_scalar(_: &Value) -> Option<Result<Self, String>> {
        None
    }

    /// A list.
    fn of_list<'de, D: Deserializer<'de>>(_: D) -> Option<Result<Self, D::Error>> {
        None
    }

    /// Keys and values.
    fn of_section<'de, D: Deserializer<'de>>(_: D) -> Option<Result<Self, D::Error>> {
        None
    }

    /// Reads it in any notation.
    ///
    /// # Errors
    /// The value found instead, or its problem.
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Either(PhantomData))
    }
}

/// The meaning of a word; `None` for a number.
pub fn named<T: DeserializeOwned>(word: &Value) -> Option<Result<T, String>> {
    let read = || serde_yaml::from_value(word.clone()).map_err(|error| error.to_string());
    word.is_string().then(read)
}

struct Either<T>(PhantomData<T>);

impl<T: Ways> Either<T> {
    fn scalar<E: Error>(self, value: &Value, found: Unexpected<'_>) -> Result<T, E> {
        let read = T::of_scalar(value).ok_or_else(|| E::invalid_type(found, &self))?;
        read.map_err(E::custom)
    }
}

impl<'de, T: Ways> Visitor<'de> for Either<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<T, E> {
        self.scalar(&number.into(), Unexpected::Unsigned(number))
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<T, E> {
        self.scalar(&number.into(), Unexpected::Signed(number))
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<T, E> {
        self.scalar(&number.into(), Unexpected::Float(number))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        self.scalar(&text.into(), Unexpected::Str(text))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T, A::Error> {
        T::of_list(SeqAccessDeserializer::new(list))
            .unwrap_or_else(|| Err(A::Error::invalid_type(Unexpected::Seq, &self)))
    }

    fn visit_map<A: MapAccess<'de>>(self, section: A) -> Result<T, A::Error> {
        T::of_section(MapAccessDeserializer::new(section))
            .unwrap_or_else(|| Err(A::Error::invalid_type(Unexpected::Map, &self)))
    }
}

// [`ShortForm`]: sections that may be written as one number: `lr: 3e-4`.

/// A section that can be written as a number.
pub trait ShortForm: DeserializeOwned + JsonSchema {
    /// The meaning of the number, for the reference page.
    const NUMBER: &'static str;
    /// Its type in a JSON schema, and its range.
    const TYPE: &'static str;
    const RANGE: [f64; 2];

    /// The section meant by the number.
    ///
    /// # Errors
    /// Why the number is invalid.
    fn of_number(number: f64) -> Result<Self, String>;
}

/// Both ways of writing it.
pub fn short_form_schema<T: ShortForm>(generator: &mut SchemaGenerator) -> Schema {
    let section = generator.subschema_for::<T>();
    let [low, high] = T::RANGE;
    let number = json_schema!({
        "type": T::TYPE, "minimum": low, "maximum": high, "description": T::NUMBER,
    });
    json_schema!({"anyOf": [number, section]})
}

impl<T: ShortForm> Ways for T {
    const EXPECTED: &'static str = "a number, or a section";

    fn of_scalar(value: &Value) -> Option<Result<Self, String>> {
        Some(number::of_value(value).and_then(T::of_number))
    }

    fn of_section<'de, D: Deserializer<'de>>(section: D) -> Option<Result<Self, D::Error>> {
        Some(T::deserialize(section))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amounts_are_read_with_their_units() {
        let read = |text: &str| parse_bytes(text).unwrap();
        assert_eq!(read("8GB"), 8_000_000_000);
        assert_eq!(read("2e9"), 2_000_000_000);
        assert_eq!(read("1.5 GiB"), 3 << 29);
        assert_eq!(read("512m"), 512_000_000);
        for wrong in ["", "GB", "-1GB", "8 elephants", "inf", "NaN"] {
            assert!(parse_bytes(wrong).is_err(), "{wrong}");
        }
    }
}
