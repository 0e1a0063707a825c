//! What a file imports, names by path and defines.

use std::collections::BTreeSet;

use crate::tokens::{Token, tokens};

/// A path as it is written, and where.
#[derive(Clone, Debug)]
pub struct Path {
    pub segments: Vec<String>,
    pub line: usize,
}

/// A leaf of a `use`: its path, and the name that it has in the file.
#[derive(Clone, Debug)]
pub struct Import {
    pub path: Path,
    /// `*` for all names of a module.
    pub name: String,
    /// Whether others may see it: a name that is passed on is not yet used.
    pub public: bool,
}

/// What one file says, but for what only tests see.
#[derive(Debug, Default)]
pub struct Said {
    pub imports: Vec<Import>,
    /// Paths of two words or more that stand in code.
    pub paths: Vec<Path>,
    /// Modules in files of their own.
    pub children: BTreeSet<String>,
    /// Those of them, and others, that only tests see.
    pub test_modules: BTreeSet<String>,
    /// Every word outside of imports.
    pub words: BTreeSet<String>,
    /// Words that an item is called by.
    pub items: BTreeSet<String>,
}

/// Reads a file.
pub fn said(source: &str) -> Said {
    let (tokens, test_modules) = tokens(source);
    let mut said = Said { test_modules, ..Said::default() };
    let mut at = 0;
    while at < tokens.len() {
        at = if tokens[at].is("use") && !tokens[at + 1].is("<") {
            let public = is_public(&tokens[..at]);
            let mut tree = Tree { tokens: &tokens, at: at + 1, public, found: Vec::new() };
            tree.read(&[]);
            let end = tree.at;
            said.imports.append(&mut tree.found);
            end
        } else {
            word(&tokens, at, &mut said)
        };
    }
    said
}

fn is_public(before: &[Token]) -> bool {
    let last = before.last().is_some_and(|token| token.is("pub"));
    // `pub(crate)`, `pub(super)`.
    let limited = before.len() > 3 && before[before.len() - 4].is("pub");
    last || limited && before[before.len() - 3].is("(")
}

/// Reads the word or the path at `at`, and gives where the next begins.
fn word(tokens: &[Token], at: usize, said: &mut Said) -> usize {
    let is = |at: usize, text: &str| tokens.get(at).is_some_and(|token| token.is(text));
    let is_word = |at: usize| tokens.get(at).is_some_and(Token::is_word);
    if !is_word(at) {
        return at + 1;
    }
    const ITEMS: [&str; 8] =
        ["struct", "enum", "fn", "const", "static", "type", "trait", "macro_rules"];
    let name = if is(at + 1, "!") { at + 2 } else { at + 1 };
    if ITEMS.iter().any(|item| tokens[at].is(item)) && is_word(name) {
        said.items.insert(tokens[name].text.clone());
    }
    if is(at, "mod") && is(at + 2, ";") {
        said.children.insert(tokens[at + 1].text.clone());
        return at + 3;
    }
    let mut end = at + 1;
    while is(end, "::") && is_word(end + 1) {
        end += 2;
    }
    let words = (at..end).step_by(2).map(|at| tokens[at].text.clone());
    said.words.extend(words.clone());
    let goes_on = at > 0 && (is(at - 1, "::") || is(at - 1, "in"));
    if end > at + 1 && !goes_on {
        said.paths.push(Path { segments: words.collect(), line: tokens[at].line });
    }
    end
}

/// `a::{b, c::{self, d as e}, f::*}` from its first word on.
struct Tree<'a> {
    tokens: &'a [Token],
    at: usize,
    public: bool,
    found: Vec<Import>,
}

impl Tree<'_> {
    fn read(&mut self, above: &[String]) {
        let mut path = above.to_vec();
        let line = self.tokens[self.at].line;
        loop {
            let token = &self.tokens[self.at];
            self.at += 1;
            match token.text.as_str() {
                "{" => return self.branches(&path),
                "*" => return self.leaf(path, "*".to_string(), line),
                "self" if !path.is_empty() => {}
                "::" => continue,
                "$" => continue,
                text => path.push(text.to_string()),
            }
            if self.tokens[self.at].is("as") {
                let name = self.tokens[self.at + 1].text.clone();
                self.at += 2;
                return self.leaf(path, name, line);
            }
            if !self.tokens[self.at].is("::") {
                let name = path.last().expect("a path has a word").clone();
                return self.leaf(path, name, line);
            }
        }
    }

    fn branches(&mut self, path: &[String]) {
        while !self.tokens[self.at].is("}") {
            self.read(path);
            if self.tokens[self.at].is(",") {
                self.at += 1;
            }
        }
        self.at += 1;
    }

    fn leaf(&mut self, segments: Vec<String>, name: String, line: usize) {
        let path = Path { segments, line };
        self.found.push(Import { path, name, public: self.public });
    }
}
