//! Rust source into words and signs, without comments, strings and code that only tests see.

use std::collections::BTreeSet;

/// A word, `::` or a single sign, and the line that it stands in.
#[derive(Clone, Debug)]
pub struct Token {
    pub text: String,
    pub line: usize,
}

impl Token {
    pub fn is(&self, text: &str) -> bool {
        self.text == text
    }

    pub fn is_word(&self) -> bool {
        self.text.starts_with(is_word)
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// What is compiled without tests, and the names of the modules that only tests see.
pub fn tokens(source: &str) -> (Vec<Token>, BTreeSet<String>) {
    without_tests(&Reader { rest: source, line: 1, found: Vec::new() }.read())
}

struct Reader<'a> {
    rest: &'a str,
    line: usize,
    found: Vec<Token>,
}

impl Reader<'_> {
    fn read(mut self) -> Vec<Token> {
        while let Some(first) = self.rest.chars().next() {
            let hashes = self.raw_string();
            if self.rest.starts_with("//") {
                self.skip(self.rest.find('\n').unwrap_or(self.rest.len()));
            } else if self.rest.starts_with("/*") {
                self.skip(self.rest.find("*/").map_or(self.rest.len(), |at| at + 2));
            } else if let Some(hashes) = hashes {
                let end = format!("\"{}", "#".repeat(hashes));
                let start = self.rest.find('"').expect("a raw string has a quote") + 1;
                let length = self.rest[start..].find(&end).expect("a raw string ends");
                self.skip(start + length + end.len());
            } else if first == '"' {
                self.string();
            } else if first == '\'' {
                self.skip(quoted(self.rest));
            } else if is_word(first) {
                let end = self.rest.find(|c| !is_word(c)).unwrap_or(self.rest.len());
                self.push(end);
            } else if self.rest.starts_with("::") {
                self.push(2);
            } else if first.is_whitespace() {
                self.skip(first.len_utf8());
            } else {
                self.push(first.len_utf8());
            }
        }
        self.found
    }

    fn skip(&mut self, bytes: usize) {
        let (over, rest) = self.rest.split_at(bytes);
        self.line += over.matches('\n').count();
        self.rest = rest;
    }

    fn push(&mut self, bytes: usize) {
        self.found.push(Token { text: self.rest[..bytes].to_string(), line: self.line });
        self.skip(bytes);
    }

    /// The hashes of the raw string that begins here.
    fn raw_string(&self) -> Option<usize> {
        let after = ["r", "br", "cr"].iter().find_map(|r| self.rest.strip_prefix(r))?;
        let hashes = after.len() - after.trim_start_matches('#').len();
        after[hashes..].starts_with('"').then_some(hashes)
    }

    /// A string, left out unless it is a path, as attributes of serde have them.
    fn string(&mut self) {
        let mut escaped = false;
        let end = self.rest[1..].find(|c| {
            let ends = c == '"' && !escaped;
            escaped = c == '\\' && !escaped;
            ends
        });
        let end = 1 + end.expect("a string ends");
        let text = &self.rest[1..end];
        if text.contains("::") && text.chars().all(|c| is_word(c) || c == ':') {
            let line = self.line;
            let path = Reader { rest: text, line, found: Vec::new() }.read();
            self.found.extend(path);
        }
        self.skip(end + 1);
    }
}

/// Bytes of the character or the lifetime that begins a text.
fn quoted(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    match (chars.next(), chars.next()) {
        (Some((_, '\\')), Some((at, escaped))) => {
            let from = at + escaped.len_utf8();
            from + text[from..].find('\'').expect("a character ends") + 1
        }
        (Some(_), Some((at, '\''))) => at + 1,
        _ => 1 + text[1..].find(|c| !is_word(c)).unwrap_or(text.len() - 1),
    }
}

fn without_tests(tokens: &[Token]) -> (Vec<Token>, BTreeSet<String>) {
    let (mut kept, mut modules) = (Vec::new(), BTreeSet::new());
    let mut at = 0;
    while at < tokens.len() {
        let Some(end) = attribute(tokens, at) else {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        };
        if !is_for_tests(&tokens[at..end]) {
            kept.extend_from_slice(&tokens[at..end]);
            at = end;
            continue;
        }
        let mut item = end;
        while let Some(end) = attribute(tokens, item) {
            item = end;
        }
        at = end_of_item(tokens, item);
        let words = &tokens[item..at];
        if let Some(keyword) = words.iter().position(|token| token.is("mod"))
            && words.last().is_some_and(|token| token.is(";"))
        {
            modules.insert(words[keyword + 1].text.clone());
        }
    }
    (kept, modules)
}

/// Where the attribute that begins here ends.
fn attribute(tokens: &[Token], at: usize) -> Option<usize> {
    let opens = tokens.get(at)?.is("#") && tokens.get(at + 1)?.is("[");
    opens.then(|| end_of_group(tokens, at + 1))
}

fn is_for_tests(attribute: &[Token]) -> bool {
    let has = |word: &str| attribute.iter().any(|token| token.is(word));
    attribute[2].is("cfg") && has("test") && !has("not")
}

/// Behind the bracket that closes the one at `at`.
fn end_of_group(tokens: &[Token], at: usize) -> usize {
    let mut depth = 0;
    for (index, token) in tokens.iter().enumerate().skip(at) {
        depth += depth_of(token);
        if depth == 0 {
            return index + 1;
        }
    }
    tokens.len()
}

fn depth_of(token: &Token) -> i32 {
    match token.text.as_str() {
        "(" | "[" | "{" => 1,
        ")" | "]" | "}" => -1,
        _ => 0,
    }
}

/// Behind the item, statement or field that begins at `at`.
fn end_of_item(tokens: &[Token], at: usize) -> usize {
    let visible = tokens[at..].iter().take_while(|token| {
        token.is("pub") || token.is("(") || token.is(")") || token.is("super") || token.is("crate")
    });
    let keyword = at + visible.count();
    let is_const = tokens[keyword].is("const") && !tokens[keyword + 1].is("fn");
    let to_semicolon =
        is_const || ["use", "static", "type", "let"].iter().any(|word| tokens[keyword].is(word));
    let mut depth = 0;
    for (index, token) in tokens.iter().enumerate().skip(at) {
        depth += depth_of(token);
        let closed = token.is("}") && !to_semicolon;
        match depth {
            0 if token.is(";") || closed => return index + 1,
            ..0 => return index,
            _ => {}
        }
    }
    tokens.len()
}
