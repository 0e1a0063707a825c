//! Which laws are tested.

use super::*;
use crate::laws::Candidate;
use crate::laws::simulated::of_split;

fn tested(unique_tokens: f64) -> Vec<Candidate> {
    let laws = fit(&of_split(unique_tokens, simulated().points()), &options()).unwrap();
    laws.judgement.recommended.unwrap().scores.into_iter().map(|score| score.law).collect()
}

#[test]
fn a_sweep_that_repeats_its_data_is_judged_by_the_joint_law_that_knows_it() {
    let most = simulated().points().iter().map(|point| point.tokens).fold(0.0, f64::max);
    for (unique_tokens, expected) in
        [(most / 2.0, Candidate::JointRepeats), (most, Candidate::Joint)]
    {
        let tested = tested(unique_tokens);
        let joint: Vec<&Candidate> = tested.iter().filter(|law| law.is_joint()).collect();
        assert_eq!(joint, [&expected], "{tested:?}");
    }
}
