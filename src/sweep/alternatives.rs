//! Entries that may be written in more than one way.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error};
use serde::ser::{Serialize, Serializer};
use serde_yaml::Value;

use crate::spec::{GeneratorKind, ScaleSpec};
use crate::sweep::sections::{Clips, Generators, LevelsSpec, ModelList, ModelRule, VocabSpec};
use crate::units::{Ways, number};

macro_rules! read_in_ways {
    ($($type:ty),*) => {$(
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Ways::read(deserializer)
            }
        }
    )*};
}
read_in_ways!(ModelList, VocabSpec, ScaleSpec, Generators);

impl Ways for ModelList {
    const EXPECTED: &'static str = "a list of models, the name of a list, or a rule over d_model";

    fn of_scalar(name: &Value) -> Option<Result<Self, String>> {
        name.as_str().map(|name| Ok(Self::Named(name.to_string())))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(Vec::deserialize(list).map(Self::List))
    }

    fn of_section<'de, D: Deserializer<'de>>(rule: D) -> Option<Result<Self, D::Error>> {
        Some(ModelRule::deserialize(rule).map(Self::Rule))
    }
}

impl Ways for VocabSpec {
    const EXPECTED: &'static str = "a number of codes, or `{levels: [8, 5, 5, 5]}`";

    fn of_scalar(size: &Value) -> Option<Result<Self, String>> {
        Some(number::whole(size).map(Self::Size))
    }

    fn of_section<'de, D: Deserializer<'de>>(levels: D) -> Option<Result<Self, D::Error>> {
        Some(LevelsSpec::deserialize(levels).map(Self::Levels))
    }
}

impl Ways for ScaleSpec {
    const EXPECTED: &'static str = "`mini`, `mid`, `full`, or a list of the codes of each scale";

    fn of_scalar(name: &Value) -> Option<Result<Self, String>> {
        named(name).map(|name| name.map(Self::Named))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(number::read(list).map(Self::List))
    }
}

impl Ways for Generators {
    const EXPECTED: &'static str = "a kind of generator, or a list of kinds";

    fn of_scalar(kind: &Value) -> Option<Result<Self, String>> {
        named(kind).map(|kind| Ok(Self(vec![kind?])))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(Vec::deserialize(list).map(Self))
    }
}

/// What a word stands for; `None` for a number.
fn named<T: DeserializeOwned>(word: &Value) -> Option<Result<T, String>> {
    let read = || serde_yaml::from_value(word.clone()).map_err(|error| error.to_string());
    word.is_string().then(read)
}

impl JsonSchema for Generators {
    fn schema_name() -> Cow<'static, str> {
        "Generators".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let one = generator.subschema_for::<GeneratorKind>();
        json_schema!({"anyOf": [one, {"type": "array", "items": one}]})
    }
}

impl<'de> Deserialize<'de> for Clips {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("auto") => Ok(Clips::Auto),
            _ => number::whole(&value)
                .map(Clips::Count)
                .map_err(|error| D::Error::custom(format!("{error}; or write `auto`"))),
        }
    }
}

impl JsonSchema for Clips {
    fn schema_name() -> Cow<'static, str> {
        "Clips".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"anyOf": [
            {"type": "integer", "description": "A number of clips."},
            {
                "const": "auto",
                "description": "As many as the longest run needs, rounded up to a power of two.",
            },
        ]})
    }
}

impl Serialize for Clips {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Clips::Auto => serializer.serialize_str("auto"),
            Clips::Count(n) => serializer.serialize_u64(*n as u64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::ScaleName;

    #[test]
    fn every_way_of_writing_an_entry_reads_back() {
        let clips = ["auto\n", "600\n"];
        for text in clips {
            let read: Clips = serde_yaml::from_str(text).unwrap();
            assert_eq!(serde_yaml::to_string(&read).unwrap(), text);
        }
        let vocab: Vec<VocabSpec> = serde_yaml::from_str("[64, 1e3, {levels: [8, 1e1]}]").unwrap();
        let scales: Vec<ScaleSpec> = serde_yaml::from_str("[mid, [1, 2, 1e1]]").unwrap();
        assert_eq!(scales, [ScaleSpec::Named(ScaleName::Mid), ScaleSpec::List(vec![1, 2, 10])]);
        let again = serde_yaml::to_string(&scales).unwrap();
        assert_eq!(serde_yaml::from_str::<Vec<ScaleSpec>>(&again).unwrap(), scales);
        let levels = VocabSpec::Levels(LevelsSpec { levels: vec![8, 10] });
        assert_eq!(vocab, [VocabSpec::Size(64), VocabSpec::Size(1000), levels]);
        let again = serde_yaml::to_string(&vocab).unwrap();
        assert_eq!(serde_yaml::from_str::<Vec<VocabSpec>>(&again).unwrap(), vocab);
    }

    #[test]
    fn an_entry_of_another_kind_is_told_what_may_stand_there() {
        let models = serde_yaml::from_str::<ModelList>("7").unwrap_err().to_string();
        assert!(models.contains("the name of a list"), "{models}");
        let vocab = serde_yaml::from_str::<VocabSpec>("-3").unwrap_err().to_string();
        assert!(vocab.contains("expected a whole number, found `-3`"), "{vocab}");
        let clips = serde_yaml::from_str::<Clips>("many").unwrap_err().to_string();
        assert!(clips.contains("found `many`; or write `auto`"), "{clips}");
    }
}
