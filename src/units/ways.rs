//! [`Ways`]: entries that may be written in more than one way, told apart by their YAML kind.
//!
//! serde's untagged enums would do the same, but forget where in the file they stand and what was
//! wrong with each way; these keep both.

use std::fmt;
use std::marker::PhantomData;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Unexpected, Visitor};
use serde_yaml::Value;

/// An entry by the ways to write it, each `None` if it is none of this entry's.
pub trait Ways: Sized {
    /// What may stand there.
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

    /// Reads it, in whichever way it is written.
    ///
    /// # Errors
    /// What stands there in its place, or what is wrong with it.
    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Either(PhantomData))
    }
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
