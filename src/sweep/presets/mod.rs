//! Whole sweeps by name: systems of papers, and small ones of the same kinds (docs/presets.md).

use std::path::Path;

use serde_yaml::Mapping;

/// The key of a sweep file that names one.
pub const PRESET: &str = "preset";

/// The key of a sweep file that names the file below it.
pub const INCLUDE: &str = "include";

/// A sweep by name.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    pub name: &'static str,
    /// A sweep file. Its comments say what it has of its source, and what it has not.
    pub text: &'static str,
}

/// Presets from the names of their files.
macro_rules! presets {
    ($($name:literal,)*) => {
        /// The names of all presets: systems of papers, then those that train in minutes.
        pub const NAMES: [&str; [$($name),*].len()] = [$($name),*];

        const PRESETS: [Preset; NAMES.len()] =
            [$(Preset { name: $name, text: include_str!(concat!($name, ".yaml")) }),*];
    };
}

presets! {
    "lg-tok",
    "lg-tok-mid",
    "lg-tok-mini",
    "mosa",
    "momask",
    "momask-lg",
    "t2m-gpt",
    "mmm",
    "scamo",
    "own-data",
    "lg-tok-nano",
    "mosa-nano",
    "momask-nano",
    "momask-lg-nano",
    "t2m-gpt-nano",
    "mmm-nano",
    "scamo-nano",
}

/// The preset of a name.
pub fn find(name: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|preset| preset.name == name)
}

/// The preset that a path names, where there is no such file.
pub fn at(path: &Path) -> Option<&'static Preset> {
    if path.is_file() { None } else { find(path.to_str()?) }
}

impl Preset {
    /// Its name in messages: `preset lg-tok`.
    pub fn title(&self) -> String {
        format!("preset {}", self.name)
    }

    /// Its own keys; it may name another preset.
    ///
    /// # Panics
    /// Its file is no mapping; a test reads every one.
    pub fn keys(&self) -> Mapping {
        serde_yaml::from_str(self.text).expect("presets are tested")
    }
}
