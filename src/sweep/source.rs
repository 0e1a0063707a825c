//! [`Source`]: a text that a sweep is read from, and where in it an entry stands.

use std::collections::HashMap;

use super::locate::{self, Location};

/// A text with keys of a sweep: a file, or a preset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// In messages: the file's path, or `preset NAME`.
    pub name: String,
    pub text: String,
    /// Paths at which it stands whole in place of the sources below it.
    pub replaces: Vec<String>,
}

impl Source {
    /// A text that stands in place of nothing.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), text: text.into(), replaces: Vec::new() }
    }

    /// Whether what stands at a path comes from here, or from nowhere below.
    fn hides(&self, path: &str) -> bool {
        self.replaces.iter().any(|whole| {
            path.strip_prefix(whole.as_str()).is_some_and(|rest| rest.starts_with(['.', '[']))
        })
    }
}

/// The entries of sources that lie over one another, the uppermost first.
pub struct Places(Vec<HashMap<String, Location>>);

impl Places {
    /// Reads every source.
    pub fn of(sources: &[Source]) -> Self {
        Self(sources.iter().map(|source| locate::locations(&source.text)).collect())
    }

    /// The index of the source that the entry at a path comes from, and its place there.
    pub fn find(&self, sources: &[Source], path: &str) -> Option<(usize, &Location)> {
        for (index, (source, places)) in sources.iter().zip(&self.0).enumerate() {
            if let Some(place) = places.get(path) {
                return Some((index, place));
            }
            if source.hides(path) {
                return None;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_found_in_the_source_that_it_comes_from() {
        let upper = Source { replaces: vec!["t".into()], ..Source::new("a", "t: {kind: x}\n") };
        let sources = [upper, Source::new("preset b", "t: {layers: 1}\ng: {v: [1]}\n")];
        let places = Places::of(&sources);
        let found = |path| places.find(&sources, path).map(|(index, _)| index);
        assert_eq!(found("t.kind"), Some(0));
        assert_eq!(found("g.v[0]"), Some(1));
        assert_eq!(found("t.layers"), None, "it was replaced");
        assert_eq!(found("s"), None);
    }
}
