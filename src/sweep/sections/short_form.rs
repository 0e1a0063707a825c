//! Sections that may be written as one number: `lr: 3e-4`.

use std::fmt;
use std::marker::PhantomData;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, Deserializer, Error, MapAccess, Visitor};
use serde_yaml::Value;

use crate::units::number;

/// A section that a number may stand for.
pub trait ShortForm: DeserializeOwned + JsonSchema {
    /// What the number is, as a sentence of the reference page.
    const NUMBER: &'static str;
    /// Its type in a JSON schema.
    const TYPE: &'static str;

    /// The section that the number stands for.
    ///
    /// # Errors
    /// A sentence on why it stands for none.
    fn of_number(number: f64) -> Result<Self, String>;
}

/// Reads a section, or the number that stands for it.
pub fn section_or_number<'de, T: ShortForm, D: Deserializer<'de>>(d: D) -> Result<T, D::Error> {
    d.deserialize_any(Either(PhantomData))
}

/// Both ways of writing it.
pub fn schema<T: ShortForm>(generator: &mut SchemaGenerator) -> Schema {
    let section = generator.subschema_for::<T>();
    json_schema!({"anyOf": [{"type": T::TYPE, "description": T::NUMBER}, section]})
}

struct Either<T>(PhantomData<T>);

impl<'de, T: ShortForm> Visitor<'de> for Either<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number, or a section")
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<T, E> {
        of(&number.into())
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<T, E> {
        of(&number.into())
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<T, E> {
        of(&number.into())
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        of(&text.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, section: A) -> Result<T, A::Error> {
        T::deserialize(MapAccessDeserializer::new(section))
    }
}

fn of<T: ShortForm, E: Error>(value: &Value) -> Result<T, E> {
    number::of_value(value).and_then(T::of_number).map_err(E::custom)
}
