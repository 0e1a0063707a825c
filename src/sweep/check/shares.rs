//! Impossible shares of the training split.

use crate::spec::Share;
use crate::sweep::command::is_torch;
use crate::sweep::problem::Problem;
use crate::sweep::sections::Sweep;

const PATH: &str = "grid.shares";

/// What is wrong with `grid.shares`.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let shares = &sweep.grid.shares;
    if shares.is_empty() {
        return vec![Problem::value(PATH, "no share, so no run").with_help("shares: [1]")];
    }
    let wrong = |(i, share): (usize, &f64)| {
        let problem = |message: String| Problem::value(format!("{PATH}[{i}]"), message);
        match Share::new(*share) {
            None => Some(
                problem(format!("{share} is no share of the data"))
                    .with_help("above 0 and up to 1"),
            ),
            Some(_) if shares[..i].contains(share) => {
                Some(problem("stands in the list a second time".into()))
            }
            Some(_) => None,
        }
    };
    let mut problems: Vec<Problem> = shares.iter().enumerate().filter_map(wrong).collect();
    let may_not_know = sweep.trainer.as_ref().is_some_and(|trainer| !is_torch(&trainer.command));
    if may_not_know && shares.iter().any(|share| *share != 1.0) {
        let message = "a trainer of your own sees all of the training split";
        problems.push(
            Problem::value(PATH, message)
                .with_help("leave it out, and make a data set of each share"),
        );
    }
    problems
}
