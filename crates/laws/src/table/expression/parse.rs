//! Tokens into a tree, by operator precedence (Pratt 1973).

use std::ops::Range;

use super::ExpressionProblem as Problem;
use super::lex::Token;
use super::tree::{Fault, Form, Function, NEGATE, NOT, Node, Operator};
use crate::table::types::Reads;

/// Levels allowed, so that no expression exhausts the stack.
const MAX_DEPTH: usize = 200;

/// The tree of all tokens of a text of `length` bytes.
pub(super) fn tree(tokens: Vec<(Token, Range<usize>)>, length: usize) -> Result<Node, Fault> {
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
            Some(Token::Number(number)) => Form::Number(number),
            Some(Token::Text(text)) => Form::Text(text),
            Some(Token::Column { name, reads }) => Form::Column { name, reads },
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
}

/// The node where it is a number.
fn number(node: Node) -> Result<Node, Fault> {
    let problem = match &node.form {
        Form::Column { name, reads: Reads::Text } => {
            Problem::TextColumn { name: name.clone(), cell: String::new() }
        }
        Form::Text(_) => Problem::Text,
        _ => return Ok(node),
    };
    Err((node.span, problem))
}

/// The node above parts of `depth` levels.
fn deepened(form: Form, span: Range<usize>, depth: usize) -> Result<Node, Fault> {
    if depth >= MAX_DEPTH {
        return Err((span, Problem::TooDeep(MAX_DEPTH)));
    }
    Ok(Node { form, span, depth: depth + 1 })
}
