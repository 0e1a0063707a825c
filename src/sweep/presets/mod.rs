//! The base of a sweep file: a preset, a complete sweep by name (docs/presets.md), or an included file with its own
//! base.

use std::path::{Path, PathBuf};

use serde_yaml::{Mapping, Value};

use super::overrides::{INCLUDE, PRESET, over};
use super::problem::{Problem, Source, SweepErrors, nearest};
use super::yaml;

/// A sweep by name.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    pub name: &'static str,
    /// A sweep file. Its comments list what it shares with its source, and the differences.
    pub text: &'static str,
}

/// Presets from the names of their files.
macro_rules! presets {
    ($($name:literal,)*) => {
        /// The names of all presets: systems of papers, then small ones that train in minutes.
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

/// The preset named by a path, if no such file exists.
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

/// All keys of a sweep, and the texts that they come from, the uppermost first.
pub(super) struct Layers {
    pub keys: Mapping,
    pub sources: Vec<Source>,
}

impl Layers {
    /// The keys of a source over those of the file that it includes, over those of the preset that either names; `above`
    /// are the files that include this one.
    ///
    /// # Errors
    /// A file cannot be read, is no YAML or includes itself; there is no preset of that name.
    pub fn of(
        mut own: Mapping,
        mut source: Source,
        above: &[PathBuf],
    ) -> Result<Self, SweepErrors> {
        let named = |name: &Value| !name.is_null();
        let include = own.remove(INCLUDE).filter(named);
        let preset = own.remove(PRESET).filter(named);
        let below = match (&include, &preset) {
            (Some(file), preset) => Self::of_file(file, preset.as_ref(), &source, above)?,
            (None, Some(name)) => Self::of_preset(name, &source)?,
            (None, None) => return Ok(Self { keys: own, sources: vec![source] }),
        };
        let (mut keys, replaced) = over(own, below.keys);
        let names = [(INCLUDE, include), (PRESET, preset)];
        keys.extend(names.into_iter().filter_map(|(key, name)| Some((key.into(), name?))));
        source.replaces = replaced;
        Ok(Self { keys, sources: [vec![source], below.sources].concat() })
    }

    /// The keys of a file, relative to the folder of the including one; `preset` overrides its own preset.
    fn of_file(
        file: &Value,
        preset: Option<&Value>,
        by: &Source,
        above: &[PathBuf],
    ) -> Result<Self, SweepErrors> {
        let wrong = |message: String| SweepErrors::of(Problem::value(INCLUDE, message), by.clone());
        let name = file.as_str().ok_or_else(|| wrong("expected the path of a file".into()))?;
        let including = PathBuf::from(&by.name);
        let path = including.parent().unwrap_or(Path::new("")).join(name);
        let above = [above, &[including]].concat();
        if above.iter().any(|file| is_same(file, &path)) {
            return Err(wrong(format!("{} would include itself", path.display())));
        }
        let source = yaml::source(&path).map_err(|errors| {
            wrong(errors.problems.into_iter().map(|problem| problem.message).collect())
        })?;
        let mut keys = yaml::mapping(&source.text, yaml::SWEEP_FILE)
            .map_err(|problem| SweepErrors::of(problem, source.clone()))?;
        keys.extend(preset.map(|name| (PRESET.into(), name.clone())));
        Self::of(keys, source, &above)
    }

    fn of_preset(name: &Value, by: &Source) -> Result<Self, SweepErrors> {
        let wrong = |message: String, help: String| {
            SweepErrors::of(Problem::value(PRESET, message).with_help(help), by.clone())
        };
        let name = name.as_str().ok_or_else(|| {
            wrong("expected the name of a preset".into(), format!("one of {}", NAMES.join(", ")))
        })?;
        let preset = find(name)
            .ok_or_else(|| wrong(format!("no preset is named `{name}`"), nearest(name, &NAMES)))?;
        Self::of(preset.keys(), Source::new(preset.title(), preset.text), &[])
    }
}

/// Whether two paths lead to one file.
fn is_same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

#[cfg(test)]
mod tests {
    use crate::sweep::{Sweep, read};
    use std::fs;
    use std::path::Path;

    fn read_of(files: &[(&str, &str)]) -> Result<Sweep, String> {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            fs::create_dir_all(folder.path().join(name).parent().unwrap_or(Path::new("")))
                .expect("made");
            fs::write(folder.path().join(name), text).expect("written");
        }
        read(&folder.path().join(files[0].0), &[]).map_err(|errors| errors.render(false))
    }

    const BASE: &str = "grid: {models: scamo, vocab: [64], budgets: [1e18]}\n\
                        train: {min_steps: 9, lr: 1e-3}\ntokenizer: {kind: patch, steps: 7}\n";

    #[test]
    fn a_file_lies_over_the_one_that_it_includes() {
        let own =
            "include: shared/base.yaml\nname: a\ntrain: {lr: {max: 1}}\ntokenizer: {kind: fsq}\n";
        let sweep = read_of(&[("own.yaml", own), ("shared/base.yaml", BASE)]).expect("a sweep");
        assert_eq!((sweep.train.min_steps, sweep.train.lr.max), (9, 1.0));
        assert_ne!(sweep.tokenizer.steps, Some(7), "a key of another kind");
    }

    #[test]
    fn a_preset_lies_below_both_whoever_names_it() {
        let below = "include: base.yaml\nname: a\npreset: scamo-nano\n";
        let sweep = read_of(&[("own.yaml", below), ("base.yaml", "train: {min_steps: 9}\n")]);
        let beside = read_of(&[
            ("own.yaml", "include: base.yaml\nname: a\n"),
            ("base.yaml", "preset: scamo-nano\ntrain: {min_steps: 9}\n"),
        ]);
        assert_eq!(sweep, beside);
        assert_eq!(sweep.expect("a sweep").train.min_steps, 9);
    }

    #[test]
    fn what_is_wrong_with_an_included_file_is_shown_in_it() {
        let own = ("own.yaml", "include: base.yaml\nname: a\n");
        let told = |base: &str| read_of(&[own, ("base.yaml", base)]).expect_err("wrong");
        let slip = told(&BASE.replace("min_steps", "min_step"));
        assert!(
            slip.contains("base.yaml:2:9") && slip.contains("did you mean `min_steps`"),
            "{slip}"
        );
        let broken = told("grid: {\n");
        assert!(broken.contains("base.yaml:") && broken.contains("not valid YAML"), "{broken}");
        let circle = told("include: own.yaml\n");
        assert!(
            circle.contains("would include itself") && circle.contains("base.yaml:1:10"),
            "{circle}"
        );
        let absent = read_of(&[own]).expect_err("wrong");
        assert!(absent.contains("own.yaml:1:10") && absent.contains("cannot read"), "{absent}");
    }
}
