//! Expressions over the columns of a table: `Model Size*1e6`, `loss < 4 and not outlier`.
//!
//! | binds | operators |
//! | --- | --- |
//! | least | `or` `\|\|` |
//! | | `and` `&&` |
//! | | `not` `!` |
//! | | `==` `=` `!=` `<` `<=` `>` `>=`, which do not chain |
//! | | `+` `-` |
//! | | `*` `/` |
//! | | unary `-` |
//! | most | `^`, from the right: 2^3^2 is 2^9 and −2^2 is −4 |
//!
//! Functions are ln, log10, log2, exp, sqrt, abs, round, floor, ceil, min and max; words are `true`
//! and `false`. A column is written by its name, spaces and dashes included: the longest matching name of the table is
//! taken. Any name may be written in backticks. Texts are in single or double quotes; a quote within is doubled.
//!
//! A comparison is 1 or 0, and every number but 0 is true. Missing values propagate through every operator: NaN for a
//! number, and a comparison with an empty cell is NaN.

mod lex;
#[cfg(test)]
mod tests;
mod tree;

use std::ops::Range;

use super::{ExpressionError, ExpressionProblem as Problem, Reads, Table};
use lex::{Token, tokens};
use tree::{Fault, Form, Function, NEGATE, NOT, Node, Operator, Value, value};

/// An expression whose names and types fit a table.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    root: Node,
}

impl Expression {
    /// Reads an expression over the columns of `table`.
    ///
    /// # Errors
    /// The part not understood, with a caret under it and the nearest valid name.
    pub fn parse(text: &str, table: &Table) -> Result<Self, ExpressionError> {
        let root = tokens(text, table).and_then(|tokens| parse(tokens, text.len()));
        let root = root.map_err(|(span, problem)| {
            ExpressionError::new(text, span, with_cell(problem, table))
        })?;
        Ok(Self { text: text.to_string(), root })
    }

    /// The expression that is the column of a name, whatever the name holds.
    pub(super) fn column(name: &str, table: &Table) -> Option<Self> {
        let reads = table.column(name)?.reads();
        let form = Form::Column { name: name.to_string(), reads };
        let root = Node { form, span: 0..name.len(), depth: 1 };
        Some(Self { text: name.to_string(), root })
    }

    /// The text as written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The value for each row; NaN where something is missing.
    ///
    /// # Errors
    /// If the expression is a text, or `table` lacks a column of the table it was read for.
    pub fn numbers(&self, table: &Table) -> Result<Vec<f64>, ExpressionError> {
        match self.value(table)? {
            Value::Numbers(numbers) => Ok(numbers.spread(table.n_rows)),
            Value::Texts(_) => {
                let problem = with_cell(self.root.not_a_number(), table);
                Err(self.error((self.root.span.clone(), problem)))
            }
        }
    }

    /// Whether each row passes: neither 0 nor missing.
    ///
    /// # Errors
    /// As [`Expression::numbers`].
    pub fn mask(&self, table: &Table) -> Result<Vec<bool>, ExpressionError> {
        let passes = |value: &f64| !value.is_nan() && *value != 0.0;
        Ok(self.numbers(table)?.iter().map(passes).collect())
    }

    /// The value for each row as text; empty if it is missing.
    pub(super) fn texts(&self, table: &Table) -> Result<Vec<String>, ExpressionError> {
        if let Form::Column { name, .. } = &self.root.form
            && let Some(super::Column::Written { cells, .. }) = table.column(name)
        {
            return Ok(cells.clone());
        }
        let shown = |x: &f64| if x.is_nan() { String::new() } else { x.to_string() };
        Ok(match self.value(table)? {
            Value::Numbers(numbers) => numbers.spread(table.n_rows).iter().map(shown).collect(),
            Value::Texts(texts) => texts.spread(table.n_rows),
        })
    }

    fn value<'a>(&'a self, table: &'a Table) -> Result<Value<'a>, ExpressionError> {
        value(&self.root, table).map_err(|fault| self.error(fault))
    }

    fn error(&self, (span, problem): Fault) -> ExpressionError {
        ExpressionError::new(&self.text, span, problem)
    }
}

/// The problem of a text column, with its first cell that is no number and why it is none.
fn with_cell(problem: Problem, table: &Table) -> Problem {
    let Problem::TextColumn { name, .. } = problem else { return problem };
    let column = table.column(&name);
    let first = column.and_then(super::Column::first_text);
    let why = match column {
        Some(super::Column::Text(cells)) => super::written::unclear(cells),
        _ => None,
    };
    let why = why.map_or_else(String::new, |why| format!(": {why}"));
    let cell = first.map(|(row, cell)| format!(" (row {row} is `{cell}`{why})"));
    Problem::TextColumn { cell: cell.unwrap_or_default(), name }
}

// Tokens into a tree, by operator precedence (Pratt 1973).

/// Levels allowed, so that no expression exhausts the stack.
const MAX_DEPTH: usize = 200;

/// The tree of all tokens of a text of `length` bytes.
fn parse(tokens: Vec<(Token, Range<usize>)>, length: usize) -> Result<Node, Fault> {
    let mut parser = Parser { tokens, at: 0, length, level: 0 };
    let root = parser.expression(0)?;
    match parser.peek() {
        None => Ok(root),
        Some(Token::Close | Token::Comma) => Err((parser.span(), Problem::Stray)),
        Some(_) => Err((parser.span(), Problem::MissingOperator)),
    }
}

struct Parser {
    tokens: Vec<(Token, Range<usize>)>,
    at: usize,
    length: usize,
    level: usize,
}

impl Parser {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.at).map(|(token, _)| token)
    }

    /// The bytes of the next token, or the end of the text.
    fn span(&self) -> Range<usize> {
        self.tokens.get(self.at).map_or(self.length..self.length, |(_, span)| span.clone())
    }

    fn take(&mut self, wanted: &Token) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += usize::from(found);
        found
    }

    /// An operand and all operators that hold it at least as tightly as `least`.
    fn expression(&mut self, least: u8) -> Result<Node, Fault> {
        self.level += 1;
        if self.level > MAX_DEPTH {
            return Err((self.span(), Problem::TooDeep(MAX_DEPTH)));
        }
        let mut left = self.operand(least)?;
        let mut compared = false;
        while let Some(Token::Operator(operator)) = self.peek().cloned() {
            let (holds, least_right) = operator.powers();
            if holds < least {
                break;
            }
            if operator.compares() && std::mem::replace(&mut compared, true) {
                return Err((self.span(), Problem::Chain));
            }
            self.at += 1;
            let right = self.expression(least_right)?;
            left = binary(operator, left, right)?;
        }
        self.level -= 1;
        Ok(left)
    }

    fn operand(&mut self, least: u8) -> Result<Node, Fault> {
        let span = self.span();
        let token = self.peek().cloned();
        self.at += 1;
        let form = match token {
            Some(Token::Leaf(form)) => form,
            Some(Token::Operator(Operator::Minus)) => {
                return self.prefixed(NEGATE, span, Form::Negate);
            }
            Some(Token::Not) if least > NOT => return Err((span, Problem::LooseNot)),
            Some(Token::Not) => return self.prefixed(NOT, span, Form::Not),
            Some(Token::Function(function)) => return self.call(function, span),
            Some(Token::Open) => return self.parenthesis(span),
            _ => return Err((span, Problem::MissingOperand)),
        };
        Ok(Node { form, span, depth: 1 })
    }

    fn prefixed(
        &mut self,
        least: u8,
        span: Range<usize>,
        form: fn(Box<Node>) -> Form,
    ) -> Result<Node, Fault> {
        let node = number(self.expression(least)?)?;
        let (span, depth) = (span.start..node.span.end, node.depth);
        deepened(form(Box::new(node)), span, depth)
    }

    fn parenthesis(&mut self, open: Range<usize>) -> Result<Node, Fault> {
        let mut inner = self.expression(0)?;
        let close = self.span();
        self.closes(&open)?;
        inner.span = open.start..close.end;
        Ok(inner)
    }

    fn closes(&mut self, open: &Range<usize>) -> Result<(), Fault> {
        if self.take(&Token::Close) {
            return Ok(());
        }
        Err(match self.peek() {
            None => (open.clone(), Problem::OpenParenthesis),
            Some(Token::Comma) => (self.span(), Problem::Stray),
            Some(_) => (self.span(), Problem::MissingOperator),
        })
    }

    fn call(&mut self, function: Function, name: Range<usize>) -> Result<Node, Fault> {
        let open = self.span();
        self.at += 1;
        let mut arguments = vec![number(self.expression(0)?)?];
        while self.take(&Token::Comma) {
            arguments.push(number(self.expression(0)?)?);
        }
        let span = name.start..self.span().end;
        self.closes(&open)?;
        let found = arguments.len();
        if (found > 1) != function.is_variadic() {
            let expected =
                if function.is_variadic() { "two arguments or more" } else { "one argument" };
            return Err((span, Problem::Arguments { function: function.name(), expected, found }));
        }
        let depth = arguments.iter().map(|node| node.depth).max().unwrap_or(0);
        deepened(Form::Call(function, arguments), span, depth)
    }
}

fn binary(operator: Operator, left: Node, right: Node) -> Result<Node, Fault> {
    let is_equality = matches!(operator, Operator::Equal | Operator::Unequal);
    let span = left.span.start..right.span.end;
    let texts = [left.is_text(), right.is_text()].map(|is_text| is_text && is_equality);
    let (left, right) = (left.beside(texts[1]), right.beside(texts[0]));
    let (left, right) = match (left.is_text(), right.is_text()) {
        (false, false) => (left, right),
        (true, true) if is_equality => (left, right),
        (a, b) if a != b && is_equality => return Err((span, Problem::MixedComparison)),
        _ => (number(left)?, number(right)?),
    };
    let depth = left.depth.max(right.depth);
    deepened(Form::Binary(operator, Box::new([left, right])), span, depth)
}

impl Node {
    /// The node as a text, if it may be one and stands beside one.
    fn beside(mut self, is_text: bool) -> Self {
        if let Form::Column { reads: reads @ Reads::Either, .. } = &mut self.form
            && is_text
        {
            *reads = Reads::Text;
        }
        self
    }

    /// Why a text will not do where a number is needed; its cell is not known here.
    fn not_a_number(&self) -> Problem {
        match &self.form {
            Form::Column { name, .. } => {
                Problem::TextColumn { name: name.clone(), cell: String::new() }
            }
            _ => Problem::Text,
        }
    }
}

/// The node where it is a number.
fn number(node: Node) -> Result<Node, Fault> {
    if node.is_text() { Err((node.span.clone(), node.not_a_number())) } else { Ok(node) }
}

/// The node above parts of `depth` levels.
fn deepened(form: Form, span: Range<usize>, depth: usize) -> Result<Node, Fault> {
    if depth >= MAX_DEPTH {
        return Err((span, Problem::TooDeep(MAX_DEPTH)));
    }
    Ok(Node { form, span, depth: depth + 1 })
}
