//! What speaks against a parametric fit, in sentences.

use crate::laws::parametric::findings::{Finding, LEAST_ROWS};
use crate::laws::parametric::influence::Influence;
use crate::laws::words::text::{count, times};

impl Finding {
    pub fn sentence(&self) -> String {
        match self {
            Self::TermAbsent(quantity) => format!(
                "The term of {quantity} is not identified: the best fit does without it, so its \
                 exponent means nothing."
            ),
            Self::AtBound(quantity, bound) => format!(
                "The exponent of {quantity} is not identified: it runs into its bound {bound}, \
                 where it is held."
            ),
            Self::NoFloor => "The floor E is not identified: the best fit has none.".into(),
            Self::FewStarts(reached, all) => format!(
                "Only {reached} of {all} starts reach the best optimum found: there may be a better one."
            ),
            Self::Unfinished(missing, all) => format!(
                "{missing} of {all} bootstrap replicates did not reach an optimum of their own."
            ),
            Self::TooFewRows(rows, coefficients) => format!(
                "{rows} rows are fewer than {LEAST_ROWS} times the {coefficients} coefficients: the law \
                 follows single rows, and its intervals are too narrow. Add runs."
            ),
            Self::FewRows(rows, coefficients) => format!(
                "{rows} rows are few for {coefficients} coefficients: drawing among so few makes \
                 intervals too narrow."
            ),
        }
    }
}

impl Influence {
    /// What of the optimal `size` hangs on which rows.
    pub(in crate::laws) fn sentence(&self, size: &str) -> String {
        let Self { budget_flops, rows, params, params_without } = self;
        let factor = (params / params_without).max(params_without / params);
        format!(
            "{} row(s) move the optimal {size} at {} FLOPs by a factor {}: without {} it is {}, with \
             them {}. Look at them, or leave them out by --where or --drop-highest.",
            rows.len(),
            count(*budget_flops),
            times(factor),
            rows.join(", "),
            count(*params_without),
            count(*params)
        )
    }
}
