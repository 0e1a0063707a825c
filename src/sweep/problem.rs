//! Problems of a sweep file, shown at their place.

use std::collections::HashMap;
use std::fmt::Write;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use saphyr_parser::{Event, Parser, Span};

/// One thing wrong with a sweep file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// The entry, as `grid.models[1].n_head`; empty for the file as a whole.
    pub path: String,
    pub message: String,
    /// The remedy.
    pub help: Option<String>,
    /// Whether the key is at fault and not its value.
    pub at_key: bool,
    /// The `--set` that it stems from, and not the file.
    pub setting: Option<String>,
    /// The place where YAML parsing failed.
    pub byte: Option<usize>,
}

impl Problem {
    /// A value that will not do.
    pub fn value(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self { path: path.into(), message: message.into(), ..Self::default() }
    }

    /// The same with advice.
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// Everything wrong with a sweep file, all at once.
#[derive(Debug, thiserror::Error)]
#[error("{}", self.render(false))]
pub struct SweepErrors {
    /// The file, and below it the presets that it lies over; at least one.
    pub sources: Vec<Source>,
    pub problems: Vec<Problem>,
}

/// Problems shown with their lines, at most.
const MOST_SHOWN: usize = 50;

/// Bytes of one of the sources.
type Place = (usize, Range<usize>);

impl SweepErrors {
    /// One problem of one text.
    pub fn of(problem: Problem, source: Source) -> Self {
        Self { sources: vec![source], problems: vec![problem] }
    }

    /// The problems with file, line and caret; coloured where `colour` says so.
    pub fn render(&self, colour: bool) -> String {
        let places = Places::of(&self.sources);
        let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
        let mut text = String::new();
        let placed = self.problems.iter().map(|problem| (self.place(problem, &places), problem));
        let mut placed: Vec<_> = placed.collect();
        placed.sort_by_key(|(place, _)| place.as_ref().map(|(index, span)| (*index, span.start)));
        let n = placed.len();
        for (place, problem) in placed.into_iter().take(MOST_SHOWN) {
            let _ = writeln!(text, "{}", renderer.render(&[self.group(problem, place)]));
        }
        if n > MOST_SHOWN {
            let _ = writeln!(text, "and {} more", n - MOST_SHOWN);
        }
        let _ = write!(text, "{}: {n} problem{}", self.file(), if n == 1 { "" } else { "s" });
        text
    }

    /// The name of the file.
    fn file(&self) -> &str {
        self.sources.first().map_or("", |source| &source.name)
    }

    /// The bytes at fault; `None` without a place in the file.
    fn place(&self, problem: &Problem, places: &Places) -> Option<Place> {
        if problem.setting.is_some() {
            return None;
        }
        if let Some(byte) = problem.byte {
            let text = &self.sources.first()?.text;
            return Some((0, text.floor_char_boundary(byte)..text.ceil_char_boundary(byte + 1)));
        }
        let (index, place) = places.find(&self.sources, &problem.path)?;
        Some((index, if problem.at_key { place.key.clone() } else { place.value.clone() }))
    }

    fn group<'a>(&'a self, problem: &'a Problem, place: Option<Place>) -> Group<'a> {
        let title = Level::ERROR.primary_title(problem.message.as_str());
        let group = match place {
            None => title.element(Level::NOTE.message(self.nowhere(problem))),
            Some((index, span)) => {
                let source = &self.sources[index];
                let mark = AnnotationKind::Primary.span(span);
                let snippet = Snippet::source(&source.text).path(&source.name);
                title.element(snippet.annotation(mark))
            }
        };
        match &problem.help {
            Some(help) => group.element(Level::HELP.message(help.as_str())),
            None => group,
        }
    }

    /// The place in words, for problems without a line: a missing key, or a `--set`.
    fn nowhere(&self, problem: &Problem) -> String {
        match (&problem.setting, problem.path.as_str()) {
            (Some(setting), path) if setting.starts_with(path) => format!("in --set {setting}"),
            (Some(setting), path) => format!("at {path} in --set {setting}"),
            (None, "") => format!("in {}", self.file()),
            (None, path) => format!("at {path} in {}", self.file()),
        }
    }
}

/// Advice for an unknown name: `did you mean …?`, or the list of valid names.
pub fn nearest(wrong: &str, valid: &[&str]) -> String {
    let best = valid
        .iter()
        .map(|name| (strsim::jaro_winkler(wrong, name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((score, name)) if score > 0.75 => format!("did you mean `{name}`?"),
        _ => format!("valid here: {}", valid.join(", ")),
    }
}

// The place of an entry such as `grid.models[1].n_head` in the texts of a sweep.

/// A text with keys of a sweep: a file, or a preset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Source {
    /// In messages: the file's path, or `preset NAME`.
    pub name: String,
    pub text: String,
    /// Paths at which it replaces the sources below it entirely.
    pub replaces: Vec<String>,
}

impl Source {
    /// A text that replaces nothing.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self { name: name.into(), text: text.into(), replaces: Vec::new() }
    }

    /// Whether the entry at a path comes from this text, not from one below.
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
        Self(sources.iter().map(|source| locations(&source.text)).collect())
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

/// Byte ranges of one entry.
#[derive(Clone, Debug, PartialEq)]
pub struct Location {
    /// The key, or the value if the entry is an item of a list.
    pub key: Range<usize>,
    pub value: Range<usize>,
}

/// Byte ranges of every entry of a YAML text, by path; empty if the text is no YAML.
pub fn locations(text: &str) -> HashMap<String, Location> {
    let bytes: Vec<usize> = text.char_indices().map(|(byte, _)| byte).chain([text.len()]).collect();
    let mut walk = Walk { bytes, stack: Vec::new(), locations: HashMap::new() };
    for (event, span) in Parser::new_from_str(text).map_while(Result::ok) {
        walk.take(&event, span);
    }
    walk.locations
}

/// A mapping or a list that is being read.
struct Open {
    path: String,
    /// Items read, in a list; `None` in a mapping.
    index: Option<usize>,
    /// The key that waits for its value, in a mapping.
    key: Option<(String, Range<usize>)>,
}

struct Walk {
    /// Byte offset of each character.
    bytes: Vec<usize>,
    stack: Vec<Open>,
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
            Some(Open { index: None, key: key @ None, .. }) => *key = Some((text.into(), range)),
            _ => {
                self.place(range);
            }
        }
    }

    fn open(&mut self, index: Option<usize>, range: Range<usize>) {
        let path = self.place(range);
        self.stack.push(Open { path, index, key: None });
    }

    /// Notes the place of a value and returns its path.
    fn place(&mut self, value: Range<usize>) -> String {
        let Some(open) = self.stack.last_mut() else { return String::new() };
        let (path, key) = match (&mut open.index, open.key.take()) {
            (Some(index), _) => {
                *index += 1;
                (format!("{}[{}]", open.path, *index - 1), value.clone())
            }
            (None, Some((name, range))) if open.path.is_empty() => (name, range),
            (None, Some((name, range))) => (format!("{}.{name}", open.path), range),
            (None, None) => (open.path.clone(), value.clone()),
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

    #[test]
    fn of_many_problems_the_first_fifty_are_shown_and_the_others_counted() {
        let items = vec!["0"; 53].join(", ");
        let source = Source::new("a", format!("seeds: [{items}]\n"));
        let problems =
            (0..53).map(|i| Problem::value(format!("seeds[{i}]"), format!("number {i}")));
        let errors = SweepErrors { sources: vec![source], problems: problems.collect() };
        let text = errors.render(false);
        assert!(text.contains("number 49") && !text.contains("number 50"), "{text}");
        assert!(text.ends_with("and 3 more\na: 53 problems"), "{text}");
    }

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
