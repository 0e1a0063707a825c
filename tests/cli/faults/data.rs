//! Data that cannot be used as a sweep asks.

use super::*;

/// Windows longer than any clip, and a context shorter than some.
#[test]
fn data_that_cannot_be_used_fails_what_needs_it_and_says_why() {
    let too_long = ("tokenizer.window=4000", "tokenizers", "4 of 4 runs have no result");
    let too_short = ("model.motion_slots=8", "runs", "raise model.motion_slots");
    for (setting, folder, words) in [too_long, too_short] {
        let place = Place::with("mini.yaml");
        let args = ["run", "mini.yaml", "--set", setting, "--set", "grid.vocab=[16]"];
        place.isoflop(&args).exits(1).says("[bad-data]").says(words);
        let failed: Vec<Value> = place
            .names(&format!("results/mini/{folder}"))
            .iter()
            .map(|id| format!("results/mini/{folder}/{id}/failure.json"))
            .filter(|path| place.path(path).exists())
            .map(|path| place.json(&path)["kind"].clone())
            .collect();
        assert!(!failed.is_empty());
        assert!(failed.iter().all(|kind| kind == "bad-data"), "{failed:?}");
        // It would end so again, so it is not tried again unasked.
        place.isoflop(&args).exits(1).does_not_say("jobs to do");
    }
}
