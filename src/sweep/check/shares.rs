//! Impossible shares of the training split.

use crate::spec::Share;
use crate::spec::is_torch;
use crate::sweep::problem::Problem;
use crate::sweep::sections::Sweep;

const PATH: &str = "grid.shares";

/// What is wrong with `grid.shares`.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let shares = &sweep.grid.shares;
    if shares.is_empty() {
        return vec![Problem::value(PATH, "no share, so no run").with_help("shares: [1]")];
    }
    let problem = |i: usize, message: String| Problem::value(format!("{PATH}[{i}]"), message);
    let wrong = |(i, share): (usize, &f64)| match Share::new(*share) {
        None => {
            let message = format!("{share} is no share of the data");
            Some(problem(i, message).with_help("above 0 and up to 1"))
        }
        Some(_) => {
            let twice = || problem(i, "stands in the list a second time".into());
            shares[..i].contains(share).then(twice)
        }
    };
    let mut problems: Vec<Problem> = shares.iter().enumerate().filter_map(wrong).collect();
    let may_not_know = sweep.trainer.as_ref().is_some_and(|trainer| !is_torch(&trainer.command));
    if may_not_know && shares.iter().any(|share| *share != 1.0) {
        let problem = Problem::value(PATH, "a trainer of your own sees all of the training split");
        problems.push(problem.with_help("leave it out, and make a data set of each share"));
    }
    problems
}
