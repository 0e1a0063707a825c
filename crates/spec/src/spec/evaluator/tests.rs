use super::*;

#[test]
fn the_rate_rises_and_falls_to_nothing() {
    let section = EvaluatorSection { steps: 300, warmup_steps: 100, ..EvaluatorSection::default() };
    let spec = section.spec();
    let rates: Vec<f64> = (0..=300).map(|step| spec.learning_rate(step)).collect();
    assert!(rates[..100].is_sorted() && rates[100..].iter().rev().is_sorted());
    assert!((rates[100] - spec.lr).abs() < 1e-12 && rates[300].abs() < 1e-12);
}

fn fields(yaml: &str) -> Vec<String> {
    let section: EvaluatorSection = serde_yaml::from_str(yaml).unwrap();
    section.problems().into_iter().map(|problem| problem.field).collect()
}

#[test]
fn every_impossible_value_is_named() {
    for kind in ["{}", "{kind: matching}", "{kind: motionclip}"] {
        assert_eq!(fields(kind), Vec::<&str>::new());
    }
    assert_eq!(fields("{heads: 3}"), ["heads"]);
    assert_eq!(fields("{batch: 1, word_drop: 1}"), ["word_drop", "batch"]);
    assert_eq!(fields("{window: 3}"), ["window"]);
    assert_eq!(fields("{pool_clips: 8}"), ["pool_clips"]);
    assert_eq!(fields("{kind: matching, margin: 0, dropout: 1}"), ["margin", "dropout"]);
}

#[test]
fn no_key_of_one_kind_is_written_for_the_other() {
    let clip = "{kind: matching, layers: 2, heads: 4, frames: 4}";
    assert_eq!(fields(clip), ["layers", "heads", "frames"]);
    let matching = "{margin: 10, mismatches: all, dropout: 0.2}";
    assert_eq!(fields(matching), ["margin", "mismatches", "dropout"]);
}

#[test]
fn a_loaded_evaluator_has_no_key_of_training() {
    assert_eq!(fields("{weights: finest}"), Vec::<&str>::new());
    assert_eq!(fields("{weights: finest, width: 512}"), ["weights"]);
    assert_eq!(fields("{weights: finest, seed: 1}"), ["weights"]);
}
