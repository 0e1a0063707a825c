//! [`EvaluatorReport`]: an evaluator's training and gates, for files and for people; [`Verdict`]: whether it passes one.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::corruption::Corruption;
use super::gates::{Corrupted, Gates};
use super::train::Course;
use crate::scores::POOL;
use crate::spec::{EvaluatorSpec, LoadedSpec};

/// Printed with every score.
pub fn comparable(spec: &EvaluatorSpec) -> String {
    let own = "scores are comparable only with those of this evaluator".to_string();
    match &spec.loaded {
        None => own,
        Some(LoadedSpec { name, .. }) => {
            format!(
                "{own},\nand with rows of `{name}` in `isoflop published` if its weights are theirs"
            )
        }
    }
}

/// The facts of an evaluator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorReport {
    pub evaluator_id: String,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
    pub n_parameters: usize,
    pub course: Course,
    pub gates: Gates,
    pub verdicts: Vec<Verdict>,
    /// Whether it passes every required gate: one that does not scores nothing.
    pub passes: bool,
}

impl EvaluatorReport {
    /// The gates that it has to pass and does not.
    pub fn failed(&self) -> impl Iterator<Item = &Verdict> {
        self.verdicts.iter().filter(|verdict| !verdict.is_enough())
    }
}

/// A line a gate, at most 80 columns wide.
pub fn table(report: &EvaluatorReport) -> String {
    let EvaluatorReport { evaluator_id, course, gates, spec, .. } = report;
    let origin = match &spec.loaded {
        None => format!("best at step {} of training", course.best_step),
        Some(LoadedSpec { name, .. }) => format!("loaded as `{name}`"),
    };
    let [first, second, third] = gates.truth.map(|precision| precision.mean);
    let mut out = format!(
        "evaluator {evaluator_id}: {} test clips, {origin}\n\
         R@1 {first:.3}, R@2 {second:.3}, R@3 {third:.3} of true motions in pools of 32, \
         of which\n{:.1} captions are not alone\n\n",
        gates.n_clips, gates.duplicates.mean,
    );
    for verdict in &report.verdicts {
        let Verdict { gate, found, wanted, passes, required } = verdict;
        let word = match (passes, required) {
            (true, _) => "ok",
            (false, true) => "FAILS",
            (false, false) => "blind",
        };
        let _ = writeln!(out, "{word:<5} {gate:<25} {found:<24} {wanted}");
    }
    let (halves, n) = (gates.halves_fid.shown(4), gates.n_clips / 2);
    let _ = write!(
        out,
        "\nFID of halves of truth: {halves}, {n} motions each\nFID of true motions from as many others:\n "
    );
    for (n, fid) in &gates.fid_by_n {
        let _ = write!(out, " {:.3} of {n}", fid.mean);
    }
    let blind = report.verdicts.iter().filter(|own| !own.passes).count();
    let verdict = match (report.passes, &spec.loaded) {
        (_, Some(_)) => format!("gates bar no loaded evaluator; {blind} are failed"),
        (true, None) => "every required gate is passed".to_string(),
        (false, None) => "required gates are failed: it scores nothing".to_string(),
    };
    out + &format!("\n{verdict};\n{}", comparable(spec))
}

// Gates.

/// Least ratio of R@1 of true motions to chance.
const TIMES_CHANCE: f64 = 8.0;

/// Largest ratio of R@1 with every caption swapped to chance.
const SWAPPED_TIMES_CHANCE: f64 = 2.0;

/// Largest ratio of the distance between motions of one caption to that of random pairs.
const SAME_CAPTION_SHARE: f64 = 0.9;

/// Least ratio of the FID of a half that is corrupted, from the other half, to the FID of halves as they were.
///
/// Both have the bias of as many motions, so a true distance of twice that bias is needed: fewer test clips make the
/// gate stricter.
const TIMES_HALVES: f64 = 3.0;

/// Whether an evaluator passes a gate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    pub gate: String,
    pub found: String,
    pub wanted: String,
    pub passes: bool,
    /// Whether an evaluator that does not pass scores nothing.
    #[serde(default = "always")]
    pub required: bool,
}

fn always() -> bool {
    true
}

impl Verdict {
    fn new(
        gate: impl Into<String>,
        found: String,
        wanted: impl Into<String>,
        passes: bool,
    ) -> Self {
        Self { gate: gate.into(), found, wanted: wanted.into(), passes, required: true }
    }

    /// Whether it bars no score.
    pub fn is_enough(&self) -> bool {
        self.passes || !self.required
    }
}

impl Gates {
    /// The verdicts of an evaluator, one a gate. None is required if others trained it: its scores are taken to stand
    /// beside published ones, whatever it is blind to.
    pub fn verdicts_of(&self, spec: &EvaluatorSpec) -> Vec<Verdict> {
        let seen = Corruption::ALL.map(|corruption| self.seen(corruption));
        let last = [Some(self.swapping()), self.spread()].into_iter().flatten();
        let all = [self.retrieval()].into_iter().chain(seen).chain(last);
        let required = |own: &Verdict| own.required && spec.loaded.is_none();
        all.map(|own| Verdict { required: required(&own), ..own }).collect()
    }

    /// Captions find their true motions.
    fn retrieval(&self) -> Verdict {
        let [found, ..] = self.truth;
        let least = TIMES_CHANCE / POOL as f64;
        let passes = found.mean - found.half_width >= least;
        let wanted = format!("≥ {least:.3}, {TIMES_CHANCE} × chance");
        Verdict::new("R@1 of true motions", found.shown(3), wanted, passes)
    }

    /// FID rises the more motions are made worse, until it is a multiple of the FID of halves.
    fn seen(&self, corruption: Corruption) -> Verdict {
        let times = |own: &Corrupted| own.halves_fid.mean / self.halves_fid.mean;
        let all: Vec<(f64, f64)> = self.of(corruption).map(|own| (own.fid, times(own))).collect();
        let rises = |two: &[(f64, f64)]| two[1].0 > two[0].0 || two[1].1 >= TIMES_HALVES;
        let rises = all.first().is_some_and(|(fid, _)| *fid > 0.0) && all.windows(2).all(rises);
        let last = all.last().map_or(0.0, |(_, times)| *times);
        let found = match rises {
            true => format!("{last:.1} × halves of truth"),
            false => all.iter().map(|(fid, _)| format!("{fid:.4}")).collect::<Vec<_>>().join(", "),
        };
        let wanted = format!("rises to ≥ {TIMES_HALVES} ×");
        let gate = format!("FID under {}", corruption.name());
        let verdict = Verdict::new(gate, found, wanted, rises && last >= TIMES_HALVES);
        Verdict { required: corruption.is_required(), ..verdict }
    }

    /// From little to much.
    fn of(&self, wanted: Corruption) -> impl Iterator<Item = &Corrupted> {
        self.corrupted.iter().filter(move |corrupted| corrupted.corruption == wanted)
    }

    /// Captions of other motions find nothing.
    fn swapping(&self) -> Verdict {
        let means: Vec<f64> = self.swapped.iter().map(|swapped| swapped.precision.mean).collect();
        let words: Vec<String> = means.iter().map(|mean| format!("{mean:.3}")).collect();
        let chance = 1.0 / POOL as f64;
        let falls = means.is_sorted_by(|a, b| a > b);
        let most = SWAPPED_TIMES_CHANCE * chance;
        let passes = falls && means.last().is_some_and(|last| *last <= most);
        let wanted = format!("≤ {most:.3} at last");
        Verdict::new("R@1 with swapped captions", words.join(" > "), wanted, passes)
    }

    /// Motions of one caption are nearer to one another than to others.
    fn spread(&self) -> Option<Verdict> {
        let same = self.same_caption?;
        let share = same.distance / same.any_distance;
        let (found, passes) = (format!("{share:.2} of any two"), share <= SAME_CAPTION_SHARE);
        let wanted = format!("≤ {SAME_CAPTION_SHARE}");
        Some(Verdict::new("spread within a caption", found, wanted, passes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluator::gates::{SameCaption, Swapped};
    use crate::scores::Repeated;
    use crate::spec::EvaluatorSection;

    fn of(mean: f64) -> Repeated {
        Repeated { mean, half_width: 0.01, repeats: 20 }
    }

    fn good() -> Gates {
        let corrupted = |corruption: Corruption| {
            let at = move |(strength, fid)| {
                let (halves_fid, precision) = (of(fid), of(0.1));
                Corrupted { corruption, strength, fid, halves_fid, precision }
            };
            corruption.strengths().iter().copied().zip([0.1, 0.2, 0.3]).map(at)
        };
        let swapped = |(share, mean)| Swapped { share, precision: of(mean) };
        Gates {
            n_clips: 100,
            truth: [0.5, 0.6, 0.7].map(of),
            halves_fid: of(0.01),
            corrupted: Corruption::ALL.into_iter().flat_map(corrupted).collect(),
            swapped: [(0.1, 0.4), (0.3, 0.3), (1.0, 0.03)].map(swapped).to_vec(),
            same_caption: Some(SameCaption { n_pairs: 9, distance: 0.5, any_distance: 1.0 }),
            duplicates: of(2.0),
            fid_by_n: Vec::new(),
        }
    }

    /// The verdicts of an evaluator that is trained here.
    fn verdicts(gates: &Gates) -> Vec<Verdict> {
        gates.verdicts_of(&EvaluatorSection::default().spec())
    }

    /// The gates that fail once something is spoilt.
    fn failing(spoil: impl Fn(&mut Gates)) -> Vec<String> {
        let mut gates = good();
        spoil(&mut gates);
        let failing = verdicts(&gates).into_iter().filter(|verdict| !verdict.passes);
        failing.map(|verdict| verdict.gate).collect()
    }

    #[test]
    fn an_evaluator_may_be_blind_to_mirroring_and_not_to_jitter() {
        let blind = |corruption: Corruption| {
            let mut gates = good();
            let of_it = |corrupted: &&mut Corrupted| corrupted.corruption == corruption;
            gates.corrupted.iter_mut().filter(of_it).for_each(|own| own.halves_fid = of(0.02));
            let all = verdicts(&gates);
            let n_failing = all.iter().filter(|verdict| !verdict.passes).count();
            (all.iter().all(Verdict::is_enough), n_failing)
        };
        assert_eq!(blind(Corruption::Mirroring), (true, 1));
        assert_eq!(blind(Corruption::Jitter), (false, 1));
    }

    #[test]
    fn each_gate_fails_by_what_it_is_for() {
        assert!(failing(|_| ()).is_empty());
        assert_eq!(failing(|gates| gates.truth[0] = of(0.255)), ["R@1 of true motions"]);
        let falls = |gates: &mut Gates| {
            gates.corrupted[0].fid = 0.25;
            gates.corrupted[1].halves_fid = of(0.02);
        };
        assert_eq!(failing(falls), ["FID under noise"]);
        assert!(failing(|gates| gates.corrupted[0].fid = 0.25).is_empty(), "20 times halves");
        let hardly = |gates: &mut Gates| gates.corrupted[5].halves_fid = of(0.029);
        assert_eq!(failing(hardly), ["FID under shuffling"]);
        assert_eq!(failing(|gates| gates.corrupted[6].fid = 0.0), ["FID under sliding"]);
        let same = |gates: &mut Gates| gates.swapped[2].precision = of(0.07);
        assert_eq!(failing(same), ["R@1 with swapped captions"]);
        let wide = SameCaption { n_pairs: 9, distance: 0.95, any_distance: 1.0 };
        assert_eq!(failing(|gates| gates.same_caption = Some(wide)), ["spread within a caption"]);
        assert!(failing(|gates| gates.same_caption = None).is_empty());
    }
}
