//! [`EvaluatorReport`]: an evaluator's training and gates, for files and for people.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::gates::Gates;
use super::train::Course;
use super::verdict::Verdict;
use crate::spec::EvaluatorSpec;

/// Stands beside every score.
const COMPARABLE: &str = "scores are comparable only with those of this evaluator";

/// What is known of an evaluator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluatorReport {
    pub evaluator_id: String,
    pub spec: EvaluatorSpec,
    pub data_digest: String,
    pub n_parameters: usize,
    pub course: Course,
    pub gates: Gates,
    pub verdicts: Vec<Verdict>,
    /// Whether it passes every gate: one that does not scores nothing.
    pub passes: bool,
}

impl EvaluatorReport {
    /// The gates that it does not pass.
    pub fn failed(&self) -> impl Iterator<Item = &Verdict> {
        self.verdicts.iter().filter(|verdict| !verdict.passes)
    }
}

/// A line a gate, at most 80 columns wide.
pub fn table(report: &EvaluatorReport) -> String {
    let EvaluatorReport { evaluator_id, course, gates, .. } = report;
    let [first, second, third] = gates.truth.map(|precision| precision.mean);
    let mut out = format!(
        "evaluator {evaluator_id}: {} test clips, best at step {} of training\n\
         R@1 {first:.3}, R@2 {second:.3}, R@3 {third:.3} of true motions in pools of 32, \
         of which\n{:.1} captions are not alone\n\n",
        gates.n_clips, course.best_step, gates.duplicates.mean,
    );
    for verdict in &report.verdicts {
        let Verdict { gate, found, wanted, passes } = verdict;
        let word = if *passes { "ok" } else { "FAILS" };
        let _ = writeln!(out, "{word:<5} {gate:<25} {found:<24} {wanted}");
    }
    let _ = write!(out, "\nFID of true motions from as many others:\n ");
    for (n, fid) in &gates.fid_by_n {
        let _ = write!(out, " {:.3} of {n}", fid.mean);
    }
    let verdict = match report.passes {
        true => "every gate is passed",
        false => "gates are failed: it scores nothing",
    };
    out + &format!("\n{verdict}; {COMPARABLE}")
}
