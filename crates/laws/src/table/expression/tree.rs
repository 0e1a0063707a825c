//! The tree of an expression, and its value for all rows at once.

use std::borrow::Cow;
use std::ops::Range;

use crate::table::{Column, ExpressionProblem as Problem, Reads, Table};

/// The problem, and its bytes.
pub(super) type Fault = (Range<usize>, Problem);

/// A part of an expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub form: Form,
    pub span: Range<usize>,
    /// Levels from here to the deepest leaf.
    pub depth: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Form {
    Number(f64),
    Text(String),
    Column { name: String, reads: Reads },
    Negate(Box<Node>),
    Not(Box<Node>),
    Binary(Operator, Box<[Node; 2]>),
    Call(Function, Vec<Node>),
}

impl Node {
    pub fn is_text(&self) -> bool {
        matches!(self.form, Form::Text(_) | Form::Column { reads: Reads::Text, .. })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operator {
    Or,
    And,
    Equal,
    Unequal,
    Less,
    AtMost,
    More,
    AtLeast,
    Plus,
    Minus,
    Times,
    Over,
    Power,
}

impl Operator {
    /// How tightly it holds the operand on its left, and on its right.
    pub fn powers(self) -> (u8, u8) {
        match self {
            Self::Or => (1, 2),
            Self::And => (3, 4),
            Self::Plus | Self::Minus => (9, 10),
            Self::Times | Self::Over => (11, 12),
            Self::Power => (15, 14),
            _ => (7, 8),
        }
    }

    pub fn compares(self) -> bool {
        self.powers() == (7, 8)
    }

    pub fn apply(self, a: f64, b: f64) -> f64 {
        let truth = |holds: bool| f64::from(u8::from(holds));
        match self {
            Self::Or => truth(a != 0.0 || b != 0.0),
            Self::And => truth(a != 0.0 && b != 0.0),
            Self::Equal => truth(a == b),
            Self::Unequal => truth(a != b),
            Self::Less => truth(a < b),
            Self::AtMost => truth(a <= b),
            Self::More => truth(a > b),
            Self::AtLeast => truth(a >= b),
            Self::Plus => a + b,
            Self::Minus => a - b,
            Self::Times => a * b,
            Self::Over => a / b,
            Self::Power => a.powf(b),
        }
    }
}

/// Binding powers of the prefix operators.
pub(super) const NOT: u8 = 5;
pub(super) const NEGATE: u8 = 13;

/// A function by its place in [`FUNCTIONS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Function(usize);

/// The arguments of a function: one, or two and more, combined from the left.
enum Takes {
    One(fn(f64) -> f64),
    Several(fn(f64, f64) -> f64),
}

const FUNCTIONS: [(&str, Takes); 11] = [
    ("ln", Takes::One(f64::ln)),
    ("log10", Takes::One(f64::log10)),
    ("log2", Takes::One(f64::log2)),
    ("exp", Takes::One(f64::exp)),
    ("sqrt", Takes::One(f64::sqrt)),
    ("abs", Takes::One(f64::abs)),
    ("round", Takes::One(f64::round)),
    ("floor", Takes::One(f64::floor)),
    ("ceil", Takes::One(f64::ceil)),
    ("min", Takes::Several(f64::min)),
    ("max", Takes::Several(f64::max)),
];

impl Function {
    pub fn names() -> impl Iterator<Item = &'static str> {
        FUNCTIONS.iter().map(|(name, _)| *name)
    }

    pub fn named(name: &str) -> Option<Self> {
        Self::names().position(|of| of == name).map(Self)
    }

    pub fn name(self) -> &'static str {
        FUNCTIONS[self.0].0
    }

    /// Whether it takes two arguments or more; the others take one.
    pub fn is_variadic(self) -> bool {
        matches!(FUNCTIONS[self.0].1, Takes::Several(_))
    }
}

// Values.

/// One value for all rows, or one a row.
pub(super) enum Values<'a, T: Clone> {
    One(T),
    Many(Cow<'a, [T]>),
}

pub(super) enum Value<'a> {
    Numbers(Values<'a, f64>),
    Texts(Values<'a, String>),
}

impl<T: Clone> Values<'_, T> {
    /// The value of each of `n` rows.
    pub fn spread(self, n: usize) -> Vec<T> {
        match self {
            Self::One(value) => vec![value; n],
            Self::Many(values) => values.into_owned(),
        }
    }

    fn map(self, of: impl Fn(&T) -> T) -> Self {
        match self {
            Self::One(value) => Self::One(of(&value)),
            Self::Many(values) => Self::Many(values.iter().map(of).collect()),
        }
    }
}

/// Joins two values row by row.
fn zip<'a, T: Clone>(
    left: &Values<T>,
    right: &Values<T>,
    join: impl Fn(&T, &T) -> f64,
) -> Values<'a, f64> {
    use Values::{Many, One};
    match (left, right) {
        (One(a), One(b)) => One(join(a, b)),
        (One(a), Many(b)) => Many(b.iter().map(|b| join(a, b)).collect()),
        (Many(a), One(b)) => Many(a.iter().map(|a| join(a, b)).collect()),
        (Many(a), Many(b)) => Many(a.iter().zip(b.iter()).map(|(a, b)| join(a, b)).collect()),
    }
}

/// NaN if either is: the standard library's powf, min and max would hide missing values.
fn present(join: impl Fn(f64, f64) -> f64) -> impl Fn(&f64, &f64) -> f64 {
    move |a, b| if a.is_nan() || b.is_nan() { f64::NAN } else { join(*a, *b) }
}

pub(super) fn value<'a>(node: &'a Node, table: &'a Table) -> Result<Value<'a>, Fault> {
    Ok(Value::Numbers(match &node.form {
        Form::Number(number) => Values::One(*number),
        Form::Text(text) => return Ok(Value::Texts(Values::One(text.clone()))),
        Form::Column { name, reads } => return column(node, name, *reads, table),
        Form::Negate(of) => numbers(of, table)?.map(|x| -x),
        Form::Not(of) => zip(&numbers(of, table)?, &Values::One(0.0), present(equal)),
        Form::Binary(operator, sides) => return binary(*operator, sides, table),
        Form::Call(function, arguments) => call(*function, arguments, table)?,
    }))
}

fn equal(a: f64, b: f64) -> f64 {
    Operator::Equal.apply(a, b)
}

fn column<'a>(node: &Node, name: &str, reads: Reads, table: &'a Table) -> Result<Value<'a>, Fault> {
    let is_text = reads == Reads::Text;
    match table.column(name) {
        Some(Column::Number(cells) | Column::Written { numbers: cells, .. }) if !is_text => {
            Ok(Value::Numbers(Values::Many(Cow::Borrowed(cells))))
        }
        Some(Column::Text(cells) | Column::Written { cells, .. }) if is_text => {
            Ok(Value::Texts(Values::Many(Cow::Borrowed(cells))))
        }
        _ => Err((node.span.clone(), Problem::OtherTable(name.to_string()))),
    }
}

fn numbers<'a>(node: &'a Node, table: &'a Table) -> Result<Values<'a, f64>, Fault> {
    match value(node, table)? {
        Value::Numbers(numbers) => Ok(numbers),
        Value::Texts(_) => Err((node.span.clone(), Problem::Text)),
    }
}

fn binary<'a>(
    operator: Operator,
    [left, right]: &'a [Node; 2],
    table: &'a Table,
) -> Result<Value<'a>, Fault> {
    let joined = match (value(left, table)?, value(right, table)?) {
        (Value::Numbers(a), Value::Numbers(b)) => zip(&a, &b, present(|a, b| operator.apply(a, b))),
        (Value::Texts(a), Value::Texts(b)) => {
            // A comparison with the empty text itself asks which cells are missing.
            let asked =
                [left, right].iter().any(|n| matches!(&n.form, Form::Text(t) if t.is_empty()));
            let truth = |a: &String, b: &String| {
                f64::from(u8::from((a == b) == (operator == Operator::Equal)))
            };
            let missing = |a: &String, b: &String| !asked && (a.is_empty() || b.is_empty());
            zip(&a, &b, |a, b| if missing(a, b) { f64::NAN } else { truth(a, b) })
        }
        _ => return Err((left.span.clone(), Problem::MixedComparison)),
    };
    Ok(Value::Numbers(joined))
}

fn call<'a>(
    function: Function,
    arguments: &'a [Node],
    table: &'a Table,
) -> Result<Values<'a, f64>, Fault> {
    let mut values = arguments.iter().map(|argument| numbers(argument, table));
    let first = values.next().unwrap_or(Ok(Values::One(f64::NAN)))?;
    match FUNCTIONS[function.0].1 {
        Takes::One(of) => Ok(first.map(|x| of(*x))),
        Takes::Several(join) => {
            values.try_fold(first, |so_far, next| Ok(zip(&so_far, &next?, present(join))))
        }
    }
}
