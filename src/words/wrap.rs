//! Sentences broken at the columns of a terminal.

use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Columns of a line where no terminal is known, and of every table.
pub const COLUMNS: usize = 80;
/// Columns of a line that can be read.
const READABLE: RangeInclusive<usize> = 60..=120;

/// Columns that sentences are broken at.
static WIDTH: AtomicUsize = AtomicUsize::new(COLUMNS);

/// Breaks all sentences from now on at the columns of a terminal, at 60 or 120 where it is narrower or
/// wider; the program says so once, where its results go to a terminal.
pub fn fit_to_terminal(columns: usize) {
    WIDTH.store(columns.clamp(*READABLE.start(), *READABLE.end()), Ordering::Relaxed);
}

/// `sentence` broken at spaces into lines of a terminal, 80 columns where none is known, the first after
/// `bullet`, the others indented as far; a single longer word stays whole. Ends with a newline.
pub fn wrap(bullet: &str, sentence: &str) -> String {
    broken(bullet, sentence, WIDTH.load(Ordering::Relaxed))
}

fn broken(bullet: &str, sentence: &str, columns: usize) -> String {
    let indent = " ".repeat(bullet.chars().count());
    let mut lines = vec![bullet.to_string()];
    let mut width = indent.len();
    for word in sentence.split_whitespace() {
        let empty = width == indent.len();
        if !empty && width + 1 + word.chars().count() > columns {
            lines.push(format!("{indent}{word}"));
            width = indent.len() + word.chars().count();
        } else {
            let line = lines.last_mut().expect("there is always a line");
            line.push_str(if empty { "" } else { " " });
            line.push_str(word);
            width += usize::from(!empty) + word.chars().count();
        }
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_as_wide_as_asked() {
        let sentence = "law ".repeat(60);
        for columns in [60, 120] {
            let widest = broken("- ", &sentence, columns).lines().map(str::len).max();
            assert!(widest.is_some_and(|widest| (columns - 4..=columns).contains(&widest)));
        }
    }

    #[test]
    fn sentences_break_before_the_last_column_and_keep_every_word() {
        let sentence = "word ".repeat(60);
        let text = wrap("  - ", &sentence);
        assert!(text.lines().all(|line| line.len() <= COLUMNS));
        assert!(text.lines().skip(1).all(|line| line.starts_with("    word")));
        assert_eq!(text.split_whitespace().filter(|word| *word == "word").count(), 60);
    }
}
