//! Which runs are off the course of the others, where a bad one moves the course around it too.

use super::course::{Judged, Place, by, judge};
use crate::laws::IsoFlopPoint;
use crate::laws::text::times;

/// Times the usual z that a run may miss by, where there are many runs.
const MOST: f64 = 5.0;
/// Degrees of freedom at which that limit is twice as high.
const FEW: f64 = 6.0;
/// Degrees of freedom below which nothing is judged.
const FEWEST: f64 = 2.5;
/// Two removals are told apart where their falls differ by this many usual z squared.
const APART: f64 = 10.0;
/// The MAD of a normal sample times this is its standard deviation.
const MAD_TO_SD: f64 = 1.4826;
/// Misses below this share of the median loss are rounding.
const ROUNDING: f64 = 1e-9;
/// One run in so many may be bad at most.
const ONE_IN: usize = 8;

/// Drops the runs that break the course of the others.
///
/// Suspects are taken out one at a time, always the run whose removal lowers the sum of squares most, so
/// that bad runs do not hide each other; the last one that misses by too much ends their list (Rosner 1983).
/// Each is then judged against the sound runs alone. The usual z is 1.4826 times their median, and, at the
/// smallest or largest size of a budget, no less than that of all budgets' such ends: a course that fits ends
/// badly is no fault of a run. Where the removal of another run would do about as well, none is dropped, and
/// both stand in a sentence.
///
/// Rosner, B. (1983), "Percentage points for a generalized ESD many-outlier procedure", Technometrics 25(2).
pub(super) fn off_course(points: &[IsoFlopPoint]) -> (Vec<Option<String>>, Vec<String>) {
    let mut tables = Tables::new(points);
    let (mut verdicts, mut doubts) = (vec![None; points.len()], Vec::new());
    if tables.scale().dof < FEWEST {
        return (verdicts, vec![NOT_JUDGED.to_string()]);
    }
    let suspects = tables.clone().suspects(points.len().div_ceil(ONE_IN));
    suspects.iter().for_each(|run| tables.drop(*run));
    for Off { runs, miss, usual } in suspects.iter().filter_map(|run| tables.off(*run)) {
        let off = format!("by {}: {} times the usual", times(miss.abs()), times(usual));
        if let [run] = runs[..] {
            verdicts[run] =
                Some(format!("its loss misses the course of the sizes around it {off}"));
            continue;
        }
        let names: Vec<&str> = runs.iter().map(|run| &*points[*run].run_id).collect();
        doubts.push(format!(
            "The stage spline dropped none of {}: one misses the course of the others {off}, and they do not \
             tell which",
            names.join(", ")
        ));
    }
    (verdicts, doubts)
}

const NOT_JUDGED: &str =
    "The stage spline judges no run: sizes and budgets are too few to tell a bad one by the others";

/// What is off the course.
struct Off {
    /// One run, or several that explain the miss alike.
    runs: Vec<usize>,
    /// The loss of the first suspect of them less what the others predict there.
    miss: f64,
    /// Its z in units of the usual.
    usual: f64,
}

// All runs, a vocabulary at a time.

#[derive(Clone)]
struct Tables<'a> {
    points: &'a [IsoFlopPoint],
    /// The runs of each vocabulary that are not taken out.
    runs: Vec<Vec<usize>>,
    judged: Vec<Vec<Judged>>,
    /// The vocabulary of each run.
    table: Vec<usize>,
    rounding: f64,
}

impl<'a> Tables<'a> {
    fn new(points: &'a [IsoFlopPoint]) -> Self {
        let all: Vec<usize> = (0..points.len()).collect();
        let runs = by(points, &all, |point| point.n_vocab);
        let judged = runs.iter().map(|runs| judge(points, runs)).collect();
        let mut table = vec![0; points.len()];
        runs.iter().enumerate().for_each(|(i, runs)| runs.iter().for_each(|run| table[*run] = i));
        let median = upper_median(points.iter().map(|point| point.loss.abs())).unwrap_or(0.0);
        Self { points, runs, judged, table, rounding: ROUNDING * median }
    }

    fn drop(&mut self, run: usize) {
        let table = self.table[run];
        self.runs[table].retain(|other| *other != run);
        self.judged[table] = judge(self.points, &self.runs[table]);
    }

    fn scale(&self) -> Scale {
        Scale::of(&self.judged.concat(), self.rounding)
    }

    /// Up to so many runs that may be bad, the worst first.
    fn suspects(mut self, most: usize) -> Vec<usize> {
        let (mut out, mut bad) = (Vec::new(), 0);
        while out.len() < most {
            let worst = self.judged.iter().flatten().max_by(|a, b| a.z.total_cmp(&b.z)).cloned();
            let Some(worst) = worst else { break };
            self.drop(worst.run);
            out.push(worst.run);
            if self.scale().forbids(&worst) {
                bad = out.len();
            }
        }
        out.truncate(bad);
        out
    }

    /// What a run that was taken out is part of, if it misses by too much.
    fn off(&self, run: usize) -> Option<Off> {
        let with = [&self.runs[self.table[run]][..], &[run]].concat();
        let scale = self.scale();
        let own = judge(self.points, &with).into_iter().find(|own| own.run == run)?;
        let usual = scale.at(own.place);
        scale.forbids(&own).then(|| Off {
            runs: own.rivals(APART * usual.powi(2)),
            miss: own.miss,
            usual: own.z / usual,
        })
    }
}

/// Ends that have a scale of their own.
const ENDS: usize = 3;

/// The usual z.
struct Scale {
    /// By [`Place`].
    of_place: [f64; 3],
    /// Runs less the coefficients that their courses take.
    dof: f64,
}

impl Scale {
    fn of(all: &[Judged], rounding: f64) -> Self {
        let whole = usual(all.iter()).unwrap_or(0.0).max(rounding);
        let end = |place: Place| {
            let own = || all.iter().filter(move |judged| judged.place == place);
            usual(own()).filter(|_| own().count() >= ENDS).unwrap_or(0.0).max(whole)
        };
        let of_place = [whole, end(Place::Smallest), end(Place::Largest)];
        Self { of_place, dof: all.iter().map(|own| own.share).sum() }
    }

    fn at(&self, place: Place) -> f64 {
        self.of_place[place as usize]
    }

    fn forbids(&self, own: &Judged) -> bool {
        self.dof >= FEWEST && own.z > MOST * (1.0 + FEW / self.dof) * self.at(own.place)
    }
}

/// The scale of some z.
fn usual<'a>(judged: impl Iterator<Item = &'a Judged>) -> Option<f64> {
    upper_median(judged.map(|own| own.z)).map(|median| MAD_TO_SD * median)
}

/// The median; of an even number the upper one.
fn upper_median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
