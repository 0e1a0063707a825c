//! Where in a YAML text a path such as `grid.models[1].n_head` stands.

use std::collections::HashMap;
use std::ops::Range;

use saphyr_parser::{Event, Parser, Span};

/// Byte ranges of one entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Location {
    /// The key, or the value where the entry is an item of a list.
    pub key: Range<usize>,
    pub value: Range<usize>,
}

/// Byte ranges of every entry of a YAML text, by path; empty where the text is no YAML.
pub fn locations(text: &str) -> HashMap<String, Location> {
    let bytes: Vec<usize> = text.char_indices().map(|(byte, _)| byte).chain([text.len()]).collect();
    let mut walk = Walk { bytes, stack: Vec::new(), locations: HashMap::new() };
    for (event, span) in Parser::new_from_str(text).map_while(Result::ok) {
        walk.take(&event, span);
    }
    walk.locations
}

/// A mapping or a list that is being read.
struct Level {
    path: String,
    /// Items read, in a list; `None` in a mapping.
    index: Option<usize>,
    /// The key that waits for its value, in a mapping.
    key: Option<(String, Range<usize>)>,
}

struct Walk {
    /// Byte offset of each character.
    bytes: Vec<usize>,
    stack: Vec<Level>,
    locations: HashMap<String, Location>,
}

impl Walk {
    fn take(&mut self, event: &Event, span: Span) {
        match event {
            Event::Scalar(text, ..) => self.scalar(text, self.range(span)),
            Event::Alias(_) => self.scalar("", self.range(span)),
            Event::MappingStart(..) => self.open(None, self.range(span)),
            Event::SequenceStart(..) => self.open(Some(0), self.range(span)),
            Event::MappingEnd | Event::SequenceEnd => {
                self.stack.pop();
            }
            _ => {}
        }
    }

    fn scalar(&mut self, text: &str, range: Range<usize>) {
        match self.stack.last_mut() {
            Some(Level { index: None, key: key @ None, .. }) => *key = Some((text.into(), range)),
            _ => {
                self.place(range);
            }
        }
    }

    fn open(&mut self, index: Option<usize>, range: Range<usize>) {
        let path = self.place(range);
        self.stack.push(Level { path, index, key: None });
    }

    /// Notes the place of a value and returns its path.
    fn place(&mut self, value: Range<usize>) -> String {
        let Some(level) = self.stack.last_mut() else { return String::new() };
        let (path, key) = match (&mut level.index, level.key.take()) {
            (Some(index), _) => {
                *index += 1;
                (format!("{}[{}]", level.path, *index - 1), value.clone())
            }
            (None, Some((name, range))) if level.path.is_empty() => (name, range),
            (None, Some((name, range))) => (format!("{}.{name}", level.path), range),
            (None, None) => (level.path.clone(), value.clone()),
        };
        self.locations.insert(path.clone(), Location { key, value });
        path
    }

    fn range(&self, span: Span) -> Range<usize> {
        let byte = |index: usize| self.bytes[index.min(self.bytes.len() - 1)];
        byte(span.start.index())..byte(span.end.index())
    }
}

#[cfg(test)]
mod tests {
    use super::locations;

    #[test]
    fn nested_keys_and_items_are_found() {
        let text = "name: ä\ngrid:\n  models:\n    - {n_head: 3}\n  vocab: [64, 256]\n";
        let locations = locations(text);
        let at = |path: &str| &text[locations[path].value.clone()];
        assert_eq!(at("grid.models[0].n_head"), "3");
        assert_eq!(at("grid.vocab[1]"), "256");
        assert_eq!(&text[locations["grid.vocab"].key.clone()], "vocab");
    }
}
