//! What is wrong with a sweep file, shown where it stands.

use std::fmt::Write;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::source::{Places, Source};

/// One thing wrong with a sweep file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// The entry, as `grid.models[1].n_head`; empty for the file as a whole.
    pub path: String,
    pub message: String,
    /// How to mend it.
    pub help: Option<String>,
    /// Whether the key is at fault and not its value.
    pub at_key: bool,
    /// The `--set` that it stems from, and not the file.
    pub setting: Option<String>,
    /// Where the file stops being YAML.
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
        for (place, problem) in placed {
            let _ = writeln!(text, "{}", renderer.render(&[self.group(problem, place)]));
        }
        let n = self.problems.len();
        let _ = write!(text, "{}: {n} problem{}", self.file(), if n == 1 { "" } else { "s" });
        text
    }

    /// The name of the file.
    fn file(&self) -> &str {
        self.sources.first().map_or("", |source| &source.name)
    }

    /// The bytes at fault; `None` for what stands nowhere in the file.
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

    /// The place in words, for what stands in no line: a missing key, or a `--set`.
    fn nowhere(&self, problem: &Problem) -> String {
        match (&problem.setting, problem.path.as_str()) {
            (Some(setting), path) if setting.starts_with(path) => format!("in --set {setting}"),
            (Some(setting), path) => format!("at {path} in --set {setting}"),
            (None, "") => format!("in {}", self.file()),
            (None, path) => format!("at {path} in {}", self.file()),
        }
    }
}
