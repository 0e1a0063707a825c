//! The words of a hierarchy with their lines.

use crate::motion::bvh::error::BvhError;

/// A word and its line, counted from 1.
#[derive(Clone, Copy, Debug)]
pub struct Word<'a> {
    pub line: usize,
    pub text: &'a str,
}

impl Word<'_> {
    /// Whether it is a word of the format, in any case.
    pub fn is(self, keyword: &str) -> bool {
        self.text.eq_ignore_ascii_case(keyword)
    }

    /// The error that something else was expected.
    pub fn instead_of(self, expected: &str) -> BvhError {
        BvhError::word(self.line, expected, self.text)
    }
}

/// The words that are left.
pub struct Words<'a> {
    words: std::vec::IntoIter<Word<'a>>,
    n_lines: usize,
}

impl<'a> Words<'a> {
    pub fn of(lines: &[&'a str]) -> Words<'a> {
        let on = |(index, line): (usize, &&'a str)| {
            line.split_whitespace().map(move |text| Word { line: index + 1, text })
        };
        let words: Vec<Word> = lines.iter().enumerate().flat_map(on).collect();
        Words { words: words.into_iter(), n_lines: lines.len() }
    }

    /// The next word; `expected` says what is looked for.
    pub fn take(&mut self, expected: &str) -> Result<Word<'a>, BvhError> {
        self.words.next().ok_or_else(|| BvhError::end(self.n_lines, expected))
    }

    pub fn is_empty(&self) -> bool {
        self.words.as_slice().is_empty()
    }

    pub fn keyword(&mut self, keyword: &str) -> Result<(), BvhError> {
        let word = self.take(keyword)?;
        if word.is(keyword) { Ok(()) } else { Err(word.instead_of(keyword)) }
    }

    /// All words up to an opening brace, joined by blanks; the brace is taken too.
    pub fn name(&mut self) -> Result<String, BvhError> {
        let mut name = Vec::new();
        loop {
            let word = self.take("a name and {")?;
            if word.text == "{" {
                return Ok(name.join(" "));
            }
            name.push(word.text);
        }
    }

    /// Three finite numbers.
    pub fn triple(&mut self) -> Result<[f64; 3], BvhError> {
        Ok([self.number()?, self.number()?, self.number()?])
    }

    fn number(&mut self) -> Result<f64, BvhError> {
        const EXPECTED: &str = "a number of the OFFSET";
        let word = self.take(EXPECTED)?;
        finite(word.text).ok_or_else(|| word.instead_of(EXPECTED))
    }
}

/// A number that is neither NaN nor infinite.
pub fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|value: &f64| value.is_finite())
}
