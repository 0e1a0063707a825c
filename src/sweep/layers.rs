//! A sweep file over the preset that it names, and that over its own.

use serde_yaml::{Mapping, Value};

use super::merge::over;
use super::nearest::nearest;
use super::presets::{self, NAMES, PRESET};
use super::problem::{Problem, SweepErrors};
use super::source::Source;

/// All keys of a sweep, and the texts that they come from, the uppermost first.
pub struct Layers {
    pub keys: Mapping,
    pub sources: Vec<Source>,
}

impl Layers {
    /// Keys that were read from a source, over those of their preset.
    ///
    /// # Errors
    /// There is no preset of that name.
    pub fn of(mut own: Mapping, mut source: Source) -> Result<Self, SweepErrors> {
        let Some(name) = own.remove(PRESET).filter(|name| !name.is_null()) else {
            return Ok(Self { keys: own, sources: vec![source] });
        };
        let Some(preset) = name.as_str().and_then(presets::find) else {
            return Err(SweepErrors { problems: vec![unknown(&name)], sources: vec![source] });
        };
        let below = Self::of(preset.keys(), Source::new(preset.title(), preset.text))?;
        let (mut keys, replaced) = over(own, below.keys);
        keys.insert(PRESET.into(), name);
        source.replaces = replaced;
        Ok(Self { keys, sources: [vec![source], below.sources].concat() })
    }
}

fn unknown(name: &Value) -> Problem {
    let Some(name) = name.as_str() else {
        return Problem::value(PRESET, "expected the name of a preset")
            .with_help(format!("one of {}", NAMES.join(", ")));
    };
    Problem::value(PRESET, format!("no preset is named `{name}`")).with_help(nearest(name, &NAMES))
}
