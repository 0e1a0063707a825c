//! The data of training: the `data` section, [`Representation`], and the `text` section ([`TextSpec`]).

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_yaml::Value;

use super::KeyProblem;
use crate::units::number::{self, plain};
use crate::units::section;

plain!(DataSource, MemberSection, BrokenFiles, LongClips, Clips);
plain!(Representation, TextEncoderKind, TextStates);

// Motion.

/// The source of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DataSource {
    /// The built-in seeded generator: never ends, needs no file.
    #[default]
    Procedural,
    /// A folder in the HumanML3D layout.
    HumanMl3d,
    /// No motion and no tokenizers: a user's trainer brings its data.
    None,
}

/// The number of training clips of the procedural source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clips {
    /// A given number.
    Count(usize),
    /// As many as the longest run needs, rounded up to a power of two.
    #[default]
    Auto,
}

/// The treatment of broken files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BrokenFiles {
    /// Leave them out, with a warning each.
    #[default]
    Skip,
    /// Stop with an error that lists them all.
    Refuse,
}

/// The use of training clips that are too long: of 200 frames or more.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LongClips {
    /// They are left out, with a warning each.
    #[default]
    Skip,
    /// Tokenizers train on windows of them too, as on those of any clip.
    Mix,
    /// Half of a tokenizer's windows are theirs, as in LG-Tok's out-of-distribution training.
    Half,
}

/// A data set of a union.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MemberSection {
    /// A folder in the HumanML3D layout, from the working folder.
    pub path: PathBuf,
    /// Its name in messages; by default the folder's.
    pub name: Option<String>,
    /// Its licence, printed in the plan.
    pub licence: Option<String>,
    /// Frames per second of its files, if not `data.fps`.
    #[serde(default, deserialize_with = "number::read")]
    #[schemars(range(min = 0.1, max = 1000))]
    pub fps: Option<f64>,
}

impl MemberSection {
    /// Its name in messages.
    pub fn name(&self) -> String {
        let folder = || self.path.file_name().unwrap_or(self.path.as_os_str());
        self.name.clone().unwrap_or_else(|| folder().to_string_lossy().into_owned())
    }
}

/// The `data` section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin<'a> {
    Procedural,
    /// A folder in the HumanML3D layout.
    Folder(&'a Path),
    Union(&'a [MemberSection]),
    None,
}

section! {
    /// The `data` section: the motion and the captions that are learned.
    pub struct DataSection {
        source: DataSource = DataSource::default();
        /// The folder of `humanml3d`, from the working folder.
        path: Option<PathBuf> = None;
        /// Several such folders in place of one: their clips together, each in its own split.
        union: Vec<MemberSection> = Vec::new();
        /// `humanml3d`: frames per second of the files. By default the rate stored by `isoflop data import`, or the
        /// layout's: 20, and 30 for Motion-X's `vector_263`.
        fps: Option<f64> = None, 0.1 to 1000;
        /// `humanml3d`: every training clip also left-right mirrored.
        mirror: bool = true;
        /// `humanml3d`: the treatment of broken files.
        broken: BrokenFiles = BrokenFiles::default();
        /// `humanml3d`: the use of training clips of 200 frames or more. Generators and evaluators never see them.
        long_clips: LongClips = LongClips::default(), unless "crate::units::is_default";
        /// `procedural`: the generator's seed.
        seed: u64 = 0, 0 to 18_446_744_073_709_551_615u64;
        /// `procedural`: clips to train on, or `auto`.
        clips: Clips = Clips::default();
        /// `procedural`: clips to validate on.
        val_clips: usize = 128, 1 to 1_000_000;
        /// `procedural`: clips to test on.
        test_clips: usize = 512, 1 to 1_000_000;
    }
}

impl DataSection {
    /// The source. A union needs no `source`.
    ///
    /// # Panics
    /// For `humanml3d` without a path, which [`DataSection::problems`] refuses.
    pub fn origin(&self) -> Origin<'_> {
        match self.source {
            _ if !self.union.is_empty() => Origin::Union(&self.union),
            DataSource::Procedural => Origin::Procedural,
            DataSource::HumanMl3d => {
                Origin::Folder(self.path.as_deref().expect("checked when the sweep was read"))
            }
            DataSource::None => Origin::None,
        }
    }

    /// Problems that make every source fail.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let united = !self.union.is_empty();
        let folder = "path: the folder that holds new_joint_vecs, vector_263 or new_joints, texts and \
                      train.txt; or union: a list of such folders";
        let alone = "leave `path` out, and `source` too, or make it humanml3d";
        let no_files = self.source != DataSource::HumanMl3d && !united;
        let no_path = "a folder, where `source` reads none";
        let no_fps = "the rate of files, where `source` reads none";
        let no_long = "clips of files, where `source` reads none";
        let skips = self.long_clips == LongClips::Skip;
        let source = Some("source: humanml3d");
        let other = united && (self.path.is_some() || self.source == DataSource::None);
        let read = self.source != DataSource::HumanMl3d || self.path.is_some() || united;
        KeyProblem::failed([
            (read, "", "`source: humanml3d` needs a `path`", Some(folder)),
            (!other, "union", "a union is all the data there is", Some(alone)),
            (!no_files || self.path.is_none(), "path", no_path, source),
            (!no_files || self.fps.is_none(), "fps", no_fps, source),
            (!no_files || skips, "long_clips", no_long, source),
        ])
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
            {
                "type": "integer",
                "minimum": 1,
                "maximum": 1_000_000_000,
                "description": "A number of clips.",
            },
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

/// Features of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Representation {
    /// All 263 of HumanML3D.
    #[default]
    Full,
    /// The first 67, the root and the positions of the joints (Meng et al. 2024, LG-Tok). Rotations,
    /// velocities and contacts of generated motion are computed from the positions.
    Meng67,
}

impl Representation {
    /// The number of features, out of `all`.
    pub fn n_features(self, all: usize) -> usize {
        match self {
            Self::Full => all,
            Self::Meng67 => all.min(67),
        }
    }
}

// Captions.

/// How captions become vectors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TextEncoderKind {
    /// Signed hashes of a word's character n-grams; deterministic, without word meanings.
    #[default]
    HashedNgrams,
    /// Vectors that another program made, looked up in a file by the caption.
    File,
    /// States of T5's encoder, as in ScaMo, from a folder with its weights. This and the following encoders need
    /// a build with `--features encoders`.
    T5,
    /// States of CLIP's text tower, from a folder.
    Clip,
    /// States of the BERT family, as MiniLM, from a folder.
    Bert,
    /// States of LLaMA, as LG-Tok has them, from a folder.
    Llama,
}

impl TextEncoderKind {
    /// Whether it computes with weights from a folder.
    pub fn has_weights(self) -> bool {
        matches!(self, Self::T5 | Self::Clip | Self::Bert | Self::Llama)
    }
}

/// The states of an encoder that represent a caption.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TextStates {
    /// One vector a token.
    #[default]
    Words,
    /// One vector: of CLIP the projected state of its end token, of others the mean of all.
    Sentence,
}

section! {
    /// The `text` section: how captions become vectors.
    pub struct TextSpec {
        encoder: TextEncoderKind = TextEncoderKind::default();
        /// The file of `file`, or the folder with `config.json`, `tokenizer.json` and `model.safetensors` of an
        /// encoder with weights, from the working folder. Ids hold their content instead.
        path: Option<PathBuf> = None, unless "Option::is_none";
        /// One vector a word, or one a caption, as the baseline without a word-level prefix has it (ScaMo, Table
        /// 2); of encoders with weights.
        states: TextStates = TextStates::default(), unless "crate::units::is_default";
        /// Width of a vector; it must match the file or the model, if there is one.
        dim: usize = 64, 1 to 65_536;
        /// Longer captions are cut here; part of n_ctx in the FLOP rule.
        max_tokens: usize = 32, 1 to 16_384;
    }
}

impl TextSpec {
    /// Problems that make every encoder fail.
    pub fn problems(&self) -> Vec<KeyProblem> {
        let Self { encoder, path, states, .. } = self;
        let (file, has_weights) = (*encoder == TextEncoderKind::File, encoder.has_weights());
        let hashed = *encoder == TextEncoderKind::HashedNgrams;
        let words = *states == TextStates::Words;
        let built = cfg!(feature = "encoders") || !has_weights;
        let in_file = "path: a file that experiments/embed_captions.py made";
        let in_folder = "path: a folder with config.json, tokenizer.json, model.safetensors";
        let no_file = "`encoder: hashed-ngrams` reads no file";
        let no_path = "take `path` out, or set `encoder: file`";
        let other = "build it with `--features encoders`, or make a file for `encoder: file`";
        let unbuilt = "this isoflop was built without encoders that have weights";
        let sentence = "`states: sentence` is of encoders with weights";
        let needs_path = "an encoder with weights needs a `path`";
        KeyProblem::failed([
            (!file || path.is_some(), "", "`encoder: file` needs a `path`", Some(in_file)),
            (!hashed || path.is_none(), "path", no_file, Some(no_path)),
            (!has_weights || path.is_some(), "", needs_path, Some(in_folder)),
            (built, "encoder", unbuilt, Some(other)),
            (
                words || has_weights,
                "states",
                sentence,
                Some("a file may hold one vector a caption"),
            ),
        ])
    }
}
