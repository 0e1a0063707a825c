//! Entries that may be written in more than one way, told apart by their YAML kind.
//!
//! serde's untagged enums would do the same, but forget where in the file they stand and what was
//! wrong with each way; these keep both.

use std::borrow::Cow;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{
    Deserialize, Deserializer, Error, IntoDeserializer, MapAccess, SeqAccess, Visitor,
};
use serde::ser::{Serialize, Serializer};

use crate::spec::{GeneratorKind, ScaleName, ScaleSpec};
use crate::sweep::sections::{Clips, Generators, LevelsSpec, ModelList, ModelRule, VocabSpec};
use crate::units::number;

impl<'de> Deserialize<'de> for ModelList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Models)
    }
}

struct Models;

impl<'de> Visitor<'de> for Models {
    type Value = ModelList;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of models, the name of a list, or a rule over d_model")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<ModelList, E> {
        Ok(ModelList::Named(name.to_string()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<ModelList, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(ModelList::List)
    }

    fn visit_map<A: MapAccess<'de>>(self, rule: A) -> Result<ModelList, A::Error> {
        ModelRule::deserialize(MapAccessDeserializer::new(rule)).map(ModelList::Rule)
    }
}

impl<'de> Deserialize<'de> for VocabSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Vocab)
    }
}

struct Vocab;

impl<'de> Visitor<'de> for Vocab {
    type Value = VocabSpec;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a number of codes, or `{levels: [8, 5, 5, 5]}`")
    }

    fn visit_u64<E: Error>(self, n: u64) -> Result<VocabSpec, E> {
        number::whole(n.into()).map(VocabSpec::Size).map_err(E::custom)
    }

    fn visit_i64<E: Error>(self, n: i64) -> Result<VocabSpec, E> {
        number::whole(n.into()).map(VocabSpec::Size).map_err(E::custom)
    }

    fn visit_f64<E: Error>(self, n: f64) -> Result<VocabSpec, E> {
        number::whole(n.into()).map(VocabSpec::Size).map_err(E::custom)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<VocabSpec, E> {
        number::whole(text.into()).map(VocabSpec::Size).map_err(E::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, levels: A) -> Result<VocabSpec, A::Error> {
        LevelsSpec::deserialize(MapAccessDeserializer::new(levels)).map(VocabSpec::Levels)
    }
}

impl<'de> Deserialize<'de> for ScaleSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Scales)
    }
}

struct Scales;

impl<'de> Visitor<'de> for Scales {
    type Value = ScaleSpec;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("`mini`, `mid`, `full`, or a list of the codes of each scale")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<ScaleSpec, E> {
        ScaleName::deserialize(name.into_deserializer()).map(ScaleSpec::Named)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<ScaleSpec, A::Error> {
        number::counts(SeqAccessDeserializer::new(list)).map(ScaleSpec::List)
    }
}

impl<'de> Deserialize<'de> for Generators {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrMore)
    }
}

struct OneOrMore;

impl<'de> Visitor<'de> for OneOrMore {
    type Value = Generators;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a kind of generator, or a list of kinds")
    }

    fn visit_str<E: Error>(self, name: &str) -> Result<Generators, E> {
        GeneratorKind::deserialize(name.into_deserializer()).map(|kind| Generators(vec![kind]))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Generators, A::Error> {
        Vec::deserialize(SeqAccessDeserializer::new(list)).map(Generators)
    }
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
        let value = serde_yaml::Value::deserialize(deserializer)?;
        match value.as_str() {
            Some("auto") => Ok(Clips::Auto),
            _ => number::whole(value)
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
