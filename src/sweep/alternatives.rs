//! Entries that may be written in more than one way.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Deserialize, Deserializer};
use serde_yaml::Value;

use crate::spec::GeneratorKind;
use crate::sweep::sections::{Generators, LevelsSpec, ModelList, ModelRule, VocabSpec};
use crate::units::{Ways, named, number};

macro_rules! read_in_ways {
    ($($type:ty),*) => {$(
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                Ways::read(deserializer)
            }
        }
    )*};
}
read_in_ways!(ModelList, VocabSpec, Generators);

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

impl Ways for Generators {
    const EXPECTED: &'static str = "a kind of generator, or a list of kinds";

    fn of_scalar(kind: &Value) -> Option<Result<Self, String>> {
        named(kind).map(|kind| Ok(Self(vec![kind?])))
    }

    fn of_list<'de, D: Deserializer<'de>>(list: D) -> Option<Result<Self, D::Error>> {
        Some(Vec::deserialize(list).map(Self))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::{Clips, ScaleName, ScaleSpec};

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
