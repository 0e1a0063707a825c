//! [`Difference`]: whether two studies differ beyond their intervals.

use serde::Serialize;

/// A value with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

/// One estimate less another of an independent study.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Difference {
    pub value: f64,
    /// `None` where one has no interval.
    pub ci95: Option<[f64; 2]>,
    /// Whether the interval leaves out zero.
    pub differs: Option<bool>,
}

impl Difference {
    /// `a − b`, with the interval that follows from theirs (Zou and Donner 2008, MOVER): each end takes the
    /// root of the squared distances that point its way, so that intervals need not be symmetric.
    pub fn of(a: Estimate, b: Estimate) -> Self {
        let value = a.value - b.value;
        let ci95 = a.ci95.zip(b.ci95).map(|([a_low, a_high], [b_low, b_high])| {
            let down = (a.value - a_low).hypot(b_high - b.value);
            let up = (a_high - a.value).hypot(b.value - b_low);
            [value - down, value + up]
        });
        Self { value, ci95, differs: ci95.map(|[low, high]| low > 0.0 || high < 0.0) }
    }
}

impl Estimate {
    /// The same on a logarithmic scale, for ratios.
    pub fn ln(self) -> Self {
        Self { value: self.value.ln(), ci95: self.ci95.map(|ends| ends.map(f64::ln)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(value: f64, low: f64, high: f64) -> Estimate {
        Estimate { value, ci95: Some([low, high]) }
    }

    #[test]
    fn alike_intervals_give_the_root_of_two() {
        let found = Difference::of(estimate(1.0, 0.9, 1.1), estimate(0.7, 0.6, 0.8));
        let [low, high] = found.ci95.unwrap();
        assert!((found.value - 0.3).abs() < 1e-12 && found.differs == Some(true));
        assert!((low - (0.3 - 0.1 * 2f64.sqrt())).abs() < 1e-12);
        assert!((high - (0.3 + 0.1 * 2f64.sqrt())).abs() < 1e-12);
    }

    #[test]
    fn each_end_sees_the_arms_that_point_its_way() {
        let found = Difference::of(estimate(1.0, 1.0, 1.3), estimate(0.8, 0.4, 0.8));
        assert_eq!(found.ci95.map(|[low, _]| low), Some(0.2_f64.min(found.value)));
        assert!((found.ci95.unwrap()[1] - 0.7).abs() < 1e-12);
        let apart = Difference::of(estimate(1.0, 0.5, 1.5), estimate(0.8, 0.7, 0.9));
        assert_eq!(apart.differs, Some(false));
    }

    #[test]
    fn without_an_interval_nothing_is_said() {
        let bare = Estimate { value: 1.0, ci95: None };
        let found = Difference::of(bare, estimate(0.8, 0.7, 0.9));
        assert_eq!((found.ci95, found.differs), (None, None));
    }
}
