//! What is wrong with an expression, with a caret under the place.

use std::fmt;
use std::ops::Range;

/// An expression that could not be understood; shown with a caret under the place.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpressionError {
    /// The whole expression.
    pub text: String,
    /// The bytes of `text` at fault.
    pub span: Range<usize>,
    pub problem: ExpressionProblem,
}

/// What is wrong there.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExpressionProblem {
    #[error("no column is named `{name}`; {hint}columns: {columns}")]
    UnknownColumn { name: String, hint: String, columns: String },

    #[error("no function is named `{name}`; {hint}functions: {functions}")]
    UnknownFunction { name: String, hint: String, functions: String },

    #[error("`{0}` has no meaning here; a name with such a character stands in backticks")]
    UnknownCharacter(char),

    #[error("`{0}` is not a number")]
    BadNumber(String),

    #[error("the quote is never closed")]
    Unclosed,

    #[error("a number, a column or a function is missing here")]
    MissingOperand,

    #[error("an operator is missing before this, such as * in `6*N`")]
    MissingOperator,

    #[error("the parenthesis is never closed")]
    OpenParenthesis,

    #[error("nothing opens what this closes or parts")]
    Stray,

    #[error("comparisons do not chain; write `a < x and x < b`")]
    Chain,

    #[error("`not` binds less than the operator before it; put it in parentheses")]
    LooseNot,

    #[error("{function} takes {expected}, not {found}")]
    Arguments { function: &'static str, expected: &'static str, found: usize },

    #[error("more than {0} levels of parentheses or operators; write it in parts")]
    TooDeep(usize),

    #[error("column `{name}` is text{cell}; a text can only be compared, with == or !=")]
    TextColumn { name: String, cell: String },

    #[error("a text can only be compared, with == or !=, to another text")]
    Text,

    #[error("a text is compared with a number")]
    MixedComparison,

    #[error("the table has no column `{0}` of the type that the expression was read for")]
    OtherTable(String),
}

impl ExpressionError {
    pub(super) fn new(text: &str, span: Range<usize>, problem: ExpressionProblem) -> Self {
        Self { text: text.to_string(), span, problem }
    }
}

impl std::error::Error for ExpressionError {}

impl fmt::Display for ExpressionError {
    /// The problem, the expression on one line, and carets under the place.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let blank = |c: char| if c.is_control() { ' ' } else { c };
        let shown: String = self.text.chars().map(blank).collect();
        let before = self.text[..self.span.start].chars().count();
        let carets = self.text[self.span.clone()].chars().count().max(1);
        writeln!(f, "{}", self.problem)?;
        writeln!(f, "  {shown}")?;
        write!(f, "  {}{}", " ".repeat(before), "^".repeat(carets))
    }
}
