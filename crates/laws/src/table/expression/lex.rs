//! Splits an expression's text into tokens.
//!
//! The meaning of a word depends on whether an operand or an operator is expected: `and` after an operand is an
//! operator, while a column may be named `and so on`. So the lexer tracks which of the two is expected.

use std::ops::Range;

use super::tree::{Fault, Form, Function, Operator};
use crate::table::{Column, ExpressionProblem as Problem, Table, hint};

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    /// A number, a text or a column.
    Leaf(Form),
    Function(Function),
    Operator(Operator),
    Not,
    Open,
    Close,
    Comma,
}

impl Token {
    /// Whether an operator may follow.
    fn ends_operand(&self) -> bool {
        matches!(self, Self::Leaf(_) | Self::Close)
    }
}

/// The tokens of a text, each with its bytes.
pub(super) fn tokens(text: &str, table: &Table) -> Result<Vec<(Token, Range<usize>)>, Fault> {
    let mut lexer = Lexer { text, table, at: 0, operand_due: true };
    let mut tokens = Vec::new();
    while let Some(first) = lexer.skip_spaces() {
        let start = lexer.at;
        let token = lexer.token(first)?;
        lexer.operand_due = !token.ends_operand();
        tokens.push((token, start..lexer.at));
    }
    Ok(tokens)
}

struct Lexer<'a> {
    text: &'a str,
    table: &'a Table,
    at: usize,
    operand_due: bool,
}

/// Longer symbols first, so that `<=` is not read as `<`.
const SYMBOLS: [(&str, Token); 20] = [
    ("&&", Token::Operator(Operator::And)),
    ("||", Token::Operator(Operator::Or)),
    ("==", Token::Operator(Operator::Equal)),
    ("!=", Token::Operator(Operator::Unequal)),
    ("<=", Token::Operator(Operator::AtMost)),
    (">=", Token::Operator(Operator::AtLeast)),
    ("=", Token::Operator(Operator::Equal)),
    ("<", Token::Operator(Operator::Less)),
    (">", Token::Operator(Operator::More)),
    ("!", Token::Not),
    ("+", Token::Operator(Operator::Plus)),
    ("-", Token::Operator(Operator::Minus)),
    ("−", Token::Operator(Operator::Minus)),
    ("*", Token::Operator(Operator::Times)),
    ("×", Token::Operator(Operator::Times)),
    ("/", Token::Operator(Operator::Over)),
    ("^", Token::Operator(Operator::Power)),
    ("(", Token::Open),
    (")", Token::Close),
    (",", Token::Comma),
];

impl Lexer<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn skip_spaces(&mut self) -> Option<char> {
        self.at += self.rest().len() - self.rest().trim_start().len();
        self.rest().chars().next()
    }

    fn token(&mut self, first: char) -> Result<Token, Fault> {
        match first {
            '0'..='9' | '.' => self.number(),
            '"' | '\'' => Ok(Token::Leaf(Form::Text(self.quoted(first)?))),
            '`' => self.backticked(),
            _ if is_word(first) => self.word(),
            _ => self.symbol(first),
        }
    }

    fn symbol(&mut self, first: char) -> Result<Token, Fault> {
        let found = SYMBOLS.into_iter().find(|(symbol, _)| self.rest().starts_with(symbol));
        let fault = || (self.at..self.at + first.len_utf8(), Problem::UnknownCharacter(first));
        let (symbol, token) = found.ok_or_else(fault)?;
        self.at += symbol.len();
        Ok(token)
    }

    /// Digits, a fraction and an exponent; a name that runs into them is left for the parser.
    fn number(&mut self) -> Result<Token, Fault> {
        let digits = |from: &str| from.bytes().take_while(u8::is_ascii_digit).count();
        let rest = self.rest();
        let mut length = digits(rest);
        if rest[length..].starts_with('.') {
            length += 1 + digits(&rest[length + 1..]);
        }
        let sign = |from: &str| usize::from(from.starts_with(['+', '-']));
        if let Some(exponent) = rest[length..].strip_prefix(['e', 'E']) {
            let signed = sign(exponent);
            let n = digits(&exponent[signed..]);
            length += if n > 0 { 1 + signed + n } else { 0 };
        }
        let written = &rest[..length];
        let fault = || (self.at..self.at + length, Problem::BadNumber(written.to_string()));
        let number = written.parse().map_err(|_| fault())?;
        self.at += length;
        Ok(Token::Leaf(Form::Number(number)))
    }

    /// The text between two `quote`s; a quote within is doubled.
    fn quoted(&mut self, quote: char) -> Result<String, Fault> {
        let open = self.at;
        let mut value = String::new();
        loop {
            self.at += 1;
            let length = self.rest().find(quote).ok_or((open..open + 1, Problem::Unclosed))?;
            value += &self.rest()[..length];
            self.at += length + 1;
            if !self.rest().starts_with(quote) {
                return Ok(value);
            }
            value.push(quote);
        }
    }

    fn backticked(&mut self) -> Result<Token, Fault> {
        let start = self.at;
        let name = self.quoted('`')?;
        let fault = (start..self.at, self.unknown_column(&name));
        self.column(&name).ok_or(fault)
    }

    fn column(&self, name: &str) -> Option<Token> {
        let reads = self.table.column(name)?.reads();
        Some(Token::Leaf(Form::Column { name: name.to_string(), reads }))
    }

    /// A word by what is expected: the longest match among column, keyword and function.
    fn word(&mut self) -> Result<Token, Fault> {
        let word = self.rest().split(|c| !is_word(c)).next().unwrap_or_default().to_string();
        let column =
            if self.operand_due { self.longest_column().to_string() } else { word.clone() };
        let token = if column.len() > word.len() { None } else { self.reserved(&word) };
        let length = if token.is_some() { word.len() } else { column.len().max(1) };
        let may_be_column = self.operand_due && !column.is_empty();
        let token = token.or_else(|| may_be_column.then(|| self.column(&column)).flatten());
        let token = token.ok_or_else(|| self.unknown(&word))?;
        self.at += length;
        Ok(token)
    }

    fn reserved(&self, word: &str) -> Option<Token> {
        let is_call = self.rest()[word.len()..].trim_start().starts_with('(');
        match (self.operand_due, word) {
            (true, "not") => Some(Token::Not),
            (true, "true") => Some(Token::Leaf(Form::Number(1.0))),
            (true, "false") => Some(Token::Leaf(Form::Number(0.0))),
            (true, name) if is_call => Function::named(name).map(Token::Function),
            (false, "and") => Some(Token::Operator(Operator::And)),
            (false, "or") => Some(Token::Operator(Operator::Or)),
            _ => None,
        }
    }

    /// The longest column name here that no further letter or digit goes on; empty for none.
    fn longest_column(&self) -> &str {
        let rest = self.rest();
        let goes_on = |name: &str| {
            let next = rest[name.len()..].chars().next();
            name.ends_with(is_word) && next.is_some_and(is_word)
        };
        let fits = |name: &&str| rest.starts_with(name) && !goes_on(name);
        self.table.names().filter(fits).max_by_key(|name| name.len()).unwrap_or_default()
    }

    fn unknown(&self, word: &str) -> Fault {
        let span = self.at..self.at + word.len();
        if !self.operand_due {
            return (span, Problem::MissingOperator);
        }
        if self.rest()[word.len()..].trim_start().starts_with('(') {
            return (span, unknown_function(word));
        }
        // Two words follow each other only around `and` and `or`: everything up to the next symbol is one
        // name.
        let run = self.rest().split(|c: char| !is_word(c) && c != ' ').next().unwrap_or(word);
        let run = run.split(" and ").next().and_then(|run| run.split(" or ").next());
        let run = run.unwrap_or(word).trim_end();
        (self.at..self.at + run.len(), self.unknown_column(run))
    }

    fn unknown_column(&self, name: &str) -> Problem {
        let columns = self.table.listed();
        let is_cell = |column: &Column| matches!(column, Column::Text(cells) if cells.iter().any(|cell| cell == name));
        let hint = match self.table.columns.iter().any(|(_, column)| is_cell(column)) {
            true => format!("did you mean the text '{name}'? "),
            false => hint(name, self.table.names()),
        };
        Problem::UnknownColumn { name: name.to_string(), hint, columns }
    }
}

fn unknown_function(name: &str) -> Problem {
    let functions = Function::names().collect::<Vec<_>>().join(", ");
    let hint = hint(name, Function::names());
    Problem::UnknownFunction { name: name.to_string(), hint, functions }
}

/// Whether a name may hold the character bare.
fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}
