//! The tree of an expression.

use std::ops::Range;

use super::ExpressionProblem;
use crate::table::nearest::name_of;
use crate::table::types::Reads;

/// What is wrong, and in which bytes.
pub(super) type Fault = (Range<usize>, ExpressionProblem);

/// A part of an expression.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub form: Form,
    pub span: Range<usize>,
    /// Levels from here to the deepest leaf.
    pub depth: usize,
}

#[derive(Clone, Debug)]
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

/// How tightly the prefixes hold what follows.
pub(super) const NOT: u8 = 5;
pub(super) const NEGATE: u8 = 13;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    Ln,
    Log10,
    Log2,
    Exp,
    Sqrt,
    Abs,
    Round,
    Floor,
    Ceil,
    Min,
    Max,
}

impl Function {
    pub const ALL: [(&'static str, Self); 11] = [
        ("ln", Self::Ln),
        ("log10", Self::Log10),
        ("log2", Self::Log2),
        ("exp", Self::Exp),
        ("sqrt", Self::Sqrt),
        ("abs", Self::Abs),
        ("round", Self::Round),
        ("floor", Self::Floor),
        ("ceil", Self::Ceil),
        ("min", Self::Min),
        ("max", Self::Max),
    ];

    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(of, _)| *of == name).map(|(_, function)| function)
    }

    pub fn name(self) -> &'static str {
        name_of(&self, &Self::ALL)
    }

    /// Whether it takes two arguments or more; the others take one.
    pub fn is_variadic(self) -> bool {
        matches!(self, Self::Min | Self::Max)
    }

    /// The value of one argument.
    pub fn of(self, x: f64) -> f64 {
        match self {
            Self::Ln => x.ln(),
            Self::Log10 => x.log10(),
            Self::Log2 => x.log2(),
            Self::Exp => x.exp(),
            Self::Sqrt => x.sqrt(),
            Self::Abs => x.abs(),
            Self::Round => x.round(),
            Self::Floor => x.floor(),
            Self::Ceil => x.ceil(),
            Self::Min | Self::Max => x,
        }
    }

    /// The value of two arguments, neither of them missing.
    pub fn pair(self, a: f64, b: f64) -> f64 {
        if self == Self::Max { a.max(b) } else { a.min(b) }
    }
}
