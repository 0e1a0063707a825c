//! [`Share`]: how much of the training split a run sees.

use serde::{Deserialize, Serialize};

/// A share of the training split's clips, above 0 and at most 1.
///
/// The tokenizer and the unigram model of L_u are those of the whole split, so that losses of different
/// shares can be compared.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Share(f64);

impl Share {
    /// All of it.
    pub const WHOLE: Self = Self(1.0);

    /// None for what is no share.
    pub fn new(share: f64) -> Option<Self> {
        (share > 0.0 && share <= 1.0).then_some(Self(share))
    }

    /// As a number.
    pub fn value(self) -> f64 {
        self.0
    }

    /// Whether it is all of the split.
    pub fn is_whole(&self) -> bool {
        self.0 == 1.0
    }

    /// ` share 0.25`, and nothing where it is all.
    pub fn said(self) -> String {
        if self.is_whole() { String::new() } else { format!(" share {}", self.0) }
    }

    /// So many of `n` things, one at least where there are any.
    pub fn of(self, n: usize) -> usize {
        ((self.0 * n as f64).round() as usize).clamp(n.min(1), n)
    }
}

impl Default for Share {
    fn default() -> Self {
        Self::WHOLE
    }
}

#[cfg(test)]
mod tests {
    use super::Share;

    #[test]
    fn shares_lie_above_0_and_up_to_1() {
        let is_share = |share| Share::new(share).is_some();
        assert_eq!(
            [0.0, 0.25, 1.0, 1.5, f64::NAN].map(is_share),
            [false, true, true, false, false]
        );
        let of = |share, n| Share::new(share).unwrap().of(n);
        assert_eq!([of(0.25, 10), of(0.01, 10), of(0.5, 0), of(1.0, 7)], [3, 1, 0, 7]);
    }
}
