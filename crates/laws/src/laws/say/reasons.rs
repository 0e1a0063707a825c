//! Why an exponent is not determined, and why a law is recommended.

use crate::laws::ranking::recommended::Score;
use crate::laws::words::text::count;

/// Why an exponent is not determined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) enum Undetermined {
    /// Fewer than three budgets have a minimum.
    FewMinima,
    OneVocabulary,
    /// The law has no optimum at one of the budgets.
    NoOptimum,
    /// The optimum lies far beyond the sizes tried.
    BeyondSizes(Beyond),
    /// It lies far beyond the vocabularies tried.
    BeyondVocabularies(Beyond),
    /// The best exponent, and an interval that is too wide.
    Wide(f64, [f64; 2]),
}

/// An optimum, and the end of what was tried that it lies beyond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct Beyond {
    pub optimum: f64,
    pub tried: f64,
}

impl Undetermined {
    pub fn sentence(self) -> String {
        match self {
            Self::FewMinima => "fewer than three budgets have a minimum of their own".into(),
            Self::OneVocabulary => "one vocabulary was tried".into(),
            Self::NoOptimum => "the law has no optimum".into(),
            Self::BeyondSizes(beyond) => beyond.sentence("size"),
            Self::BeyondVocabularies(beyond) => beyond.sentence("vocabulary"),
            Self::Wide(best, [low, high]) => {
                format!("{best:.2} fits best, but anything from {low:.2} to {high:.2} fits too")
            }
        }
    }

    /// What would settle it.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::OneVocabulary => "add vocabularies",
            Self::BeyondVocabularies(_) => "add vocabularies on that side",
            Self::BeyondSizes(_) => "add sizes on that side",
            Self::FewMinima | Self::NoOptimum | Self::Wide(..) => {
                "add budgets, or sizes on both sides of each minimum"
            }
        }
    }
}

/// Numbers below are written out.
const WRITTEN_OUT: f64 = 1e5;

impl Beyond {
    fn sentence(self, what: &str) -> String {
        let side = if self.optimum < self.tried { "smallest" } else { "largest" };
        // A vocabulary is a whole number.
        let number = |x: f64| if x < WRITTEN_OUT { format!("{x:.0}") } else { count(x) };
        format!(
            "the optimum, {}, lies far beyond the {side} {what} tried, {}",
            number(self.optimum),
            number(self.tried)
        )
    }
}

/// Why the first of some scores is that of the law to believe, of `budgets` budgets.
pub(in crate::laws) fn why_recommended(scores: &[Score], budgets: usize) -> String {
    match scores {
        [] => format!("no law could be tested ({budgets} budgets)"),
        [_] => "no other law could be tested".to_string(),
        [best, .., worst] => format!(
            "fitted to smaller budgets, it missed the losses of larger ones by {:.4} nats (root mean \
             square of {}), {} by {:.4}",
            best.rms,
            best.compared().count(),
            worst.law.about(),
            worst.rms
        ),
    }
}
