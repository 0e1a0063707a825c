//! Sections that may be written as one number: `lr: 3e-4`.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeOwned, Deserializer};
use serde_yaml::Value;

use crate::units::{Ways, number};

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

/// Both ways of writing it.
pub fn schema<T: ShortForm>(generator: &mut SchemaGenerator) -> Schema {
    let section = generator.subschema_for::<T>();
    json_schema!({"anyOf": [{"type": T::TYPE, "description": T::NUMBER}, section]})
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
