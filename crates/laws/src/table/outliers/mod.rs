//! Rows that cannot be trusted, a stage at a time; each is a pure function of the points.

mod duplicates;
mod few_levels;
mod group;
mod off_centre;
mod spline;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::nearest::{UnknownName, named};
use crate::laws::IsoFlopPoint;

/// A rule that drops rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutlierStage {
    /// Runs of one budget, V and seed whose N agree within 1 %: the first in the table stays.
    Duplicates,
    /// Budgets with fewer than three distinct N.
    FewLevels,
    /// Budgets whose parabola of loss in ln N does not open upwards, or has its vertex outside the
    /// middle 80 % of the range of ln N.
    OffCentre,
    /// Runs whose loss misses Akima's spline through the other sizes of their budget and V.
    Spline,
}

/// Points dropped, with the reason of each.
type WithReasons = Vec<(IsoFlopPoint, String)>;

impl OutlierStage {
    /// Every stage with its name.
    pub const ALL: [(&'static str, Self); 4] = [
        ("duplicates", Self::Duplicates),
        ("few-levels", Self::FewLevels),
        ("off-centre", Self::OffCentre),
        ("spline", Self::Spline),
    ];

    /// The points kept, and those dropped with the reason of each, both in the order given.
    pub fn split(self, points: Vec<IsoFlopPoint>) -> (Vec<IsoFlopPoint>, WithReasons) {
        let verdicts = match self {
            Self::Duplicates => duplicates::verdicts(&points),
            Self::FewLevels => few_levels::verdicts(&points),
            Self::OffCentre => off_centre::verdicts(&points),
            Self::Spline => spline::verdicts(&points),
        };
        let (mut kept, mut dropped) = (Vec::new(), Vec::new());
        for (point, verdict) in points.into_iter().zip(verdicts) {
            match verdict {
                None => kept.push(point),
                Some(reason) => dropped.push((point, reason)),
            }
        }
        (kept, dropped)
    }
}

impl fmt::Display for OutlierStage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

impl FromStr for OutlierStage {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, UnknownName> {
        named("stage of outliers", name, &Self::ALL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_read_by_the_name_it_prints() {
        for (name, stage) in OutlierStage::ALL {
            assert_eq!((name.parse(), stage.to_string().as_str()), (Ok(stage), name));
        }
        let error = "off-center".parse::<OutlierStage>().unwrap_err().to_string();
        assert!(error.contains("did you mean `off-centre`?"), "{error}");
    }
}
