//! Which laws are tested.

use super::*;
use crate::laws::ranking::recommended::{Candidate, Score};
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

#[test]
fn a_doubtful_minimum_takes_no_law_out_of_the_comparison() {
    let all = simulated().points();
    let smallest = all.iter().map(|point| point.budget_flops).fold(f64::INFINITY, f64::min);
    let (optimum, _) = crate::laws::simulated::known_optimum(smallest);
    // The smallest budget's sizes all lie above its optimum.
    let is_kept = |point: &IsoFlopPoint| {
        point.budget_flops > smallest || point.params_nonvocab.ln() > optimum + 0.3
    };
    let kept: Vec<IsoFlopPoint> = all.into_iter().filter(is_kept).collect();
    let laws = fit(&kept, &options()).unwrap();
    let doubtful = laws.minima.iter().find(|m| m.budget_flops == smallest).unwrap();
    assert!(!doubtful.is_usable(), "{doubtful:?}");
    let scores = laws.judgement.recommended.unwrap().scores;
    let law = |law: Candidate| scores.iter().find(|score| score.law == law).unwrap();
    let tested = |score: &Score| score.misses.iter().filter(|miss| miss.minimum.is_some()).count();
    assert_eq!(tested(law(Candidate::Log)), tested(law(Candidate::Joint)));
    // The joint law is tested where the others cannot be fitted yet, too.
    assert!(law(Candidate::Joint).misses.len() > law(Candidate::Log).misses.len());
}
