//! Reads YAML within limits: aliases and nesting can turn a few kilobytes into gigabytes.

use std::cell::Cell;
use std::fmt;
use std::path::Path;

use serde::Deserializer;
use serde::de::{DeserializeSeed, EnumAccess, Error, MapAccess, SeqAccess, VariantAccess, Visitor};
use serde_yaml::value::{Tag, TaggedValue};
use serde_yaml::{Mapping, Value};

use super::problem::{Problem, Source, SweepErrors};
use crate::files::read_text;

/// The description of a sweep file, for an error.
pub const SWEEP_FILE: &str = "a sweep file is a mapping with at least `name` and `grid`";

/// The text of a file.
///
/// # Errors
/// It cannot be read.
pub fn source(path: &Path) -> Result<Source, SweepErrors> {
    let file = path.display().to_string();
    match read_text(path) {
        Ok(text) => Ok(Source::new(file, text)),
        Err(error) => {
            let problem = Problem::value("", format!("cannot read {file}: {error}"));
            Err(SweepErrors::of(problem, Source::new(file, "")))
        }
    }
}

/// The mapping in a text; `otherwise` describes the expected content.
///
/// # Errors
/// It is not YAML, or no mapping.
pub fn mapping(text: &str, otherwise: &str) -> Result<Mapping, Problem> {
    let value = value(text).map_err(|error| Problem {
        byte: error.location().map(|location| location.index()),
        ..Problem::value("", format!("not valid YAML: {error}"))
    })?;
    match value {
        Value::Mapping(keys) => Ok(keys),
        _ => Err(Problem::value("", otherwise)),
    }
}

/// Bytes of a text.
const MOST_BYTES: usize = 1 << 20;
/// Lists and mappings within one another.
const DEEPEST: usize = 128;
/// Number of values, with those of an alias counted at each use.
const MOST_VALUES: usize = 200_000;

/// The value in a text.
///
/// # Errors
/// It is not YAML; it is too long, too deep, or holds too many values.
fn value(text: &str) -> Result<Value, serde_yaml::Error> {
    if text.len() > MOST_BYTES {
        return Err(Error::custom(format!("it is longer than {MOST_BYTES} bytes")));
    }
    if depth(text) > DEEPEST {
        return Err(Error::custom(format!("lists and mappings nest deeper than {DEEPEST}")));
    }
    Counted(&Cell::new(MOST_VALUES)).deserialize(serde_yaml::Deserializer::from_str(text))
}

/// Depth of open brackets, and of lists begun on one line; brackets in quotes and comments count too.
fn depth(text: &str) -> usize {
    let (mut open, mut most) = (0usize, 0);
    for line in text.lines() {
        let begun = line.split_whitespace().take_while(|word| ["-", "?"].contains(word)).count();
        most = most.max(begun);
        for byte in line.bytes() {
            match byte {
                b'[' | b'{' => open += 1,
                b']' | b'}' => open = open.saturating_sub(1),
                _ => {}
            }
            most = most.max(open);
        }
    }
    most
}

/// Reads one value, and counts it.
#[derive(Clone, Copy)]
struct Counted<'a>(&'a Cell<usize>);

impl<'de> DeserializeSeed<'de> for Counted<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        let left = self.0.get().checked_sub(1);
        let too_many = || D::Error::custom(format!("it holds more than {MOST_VALUES} values"));
        self.0.set(left.ok_or_else(too_many)?);
        deserializer.deserialize_any(self)
    }
}

/// Visits of plain values.
macro_rules! plain {
    ($($visit:ident: $type:ty),*) => {
        $(fn $visit<E>(self, value: $type) -> Result<Value, E> {
            Ok(value.into())
        })*
    };
}

impl<'de> Visitor<'de> for Counted<'_> {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any YAML value")
    }

    plain! { visit_bool: bool, visit_i64: i64, visit_u64: u64, visit_f64: f64, visit_str: &str }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    /// An empty document.
    fn visit_none<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut all = Vec::new();
        while let Some(item) = items.next_element_seed(self)? {
            all.push(item);
        }
        Ok(Value::Sequence(all))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut all = Mapping::new();
        while let Some(key) = entries.next_key_seed(self)? {
            if all.contains_key(&key) {
                let key = serde_yaml::to_string(&key).unwrap_or_default();
                let key = key.trim_end();
                return Err(A::Error::custom(format!("duplicate entry with key \"{key}\"")));
            }
            let value = entries.next_value_seed(self)?;
            all.insert(key, value);
        }
        Ok(Value::Mapping(all))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<Value, A::Error> {
        let (tag, content) = data.variant::<String>()?;
        let value = content.newtype_variant_seed(self)?;
        Ok(Value::Tagged(Box::new(TaggedValue { tag: Tag::new(tag), value })))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_within_bounds_is_read_as_yaml_has_it() {
        for text in [
            "name: t\ngrid: {vocab: [64, 1e3, -2, 0.5, ~, true], models: !scamo x}\n",
            "a: &a {b: [1, 'two', \"[\"]}\nc: *a\n<<: *a\n",
            "18446744073709551615",
            "",
        ] {
            let plain: Value = serde_yaml::from_str(text).unwrap();
            assert_eq!(value(text).unwrap(), plain, "{text}");
        }
        let twice = "a: 1\na: 2\n";
        let plain = serde_yaml::from_str::<Value>(twice).unwrap_err().to_string();
        assert_eq!(value(twice).unwrap_err().to_string(), plain);
    }

    #[test]
    fn a_few_kilobytes_that_mean_gigabytes_are_refused() {
        let mut laughs = "a0: &a0 [ha, ha, ha, ha, ha, ha, ha, ha, ha]\n".to_string();
        for i in 1..9 {
            let again = vec![format!("*a{}", i - 1); 9].join(", ");
            laughs += &format!("a{i}: &a{i} [{again}]\n");
        }
        let error = value(&laughs).unwrap_err().to_string();
        assert!(error.contains("more than") || error.contains("repetition"), "{error}");
        for deep in ["- ".repeat(30_000), "[".repeat(1_000_000), "{a: ".repeat(200)] {
            let error = value(&deep).unwrap_err().to_string();
            assert!(error.contains("nest deeper than 128"), "{error}");
        }
        let long = format!("a: {}", "x".repeat(MOST_BYTES));
        assert!(value(&long).unwrap_err().to_string().contains("longer than"));
    }
}
