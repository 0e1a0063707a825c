//! Runs and tokenizers that fail, and submissions that are cut off.

use std::collections::BTreeSet;
use std::os::unix::fs::PermissionsExt;

use super::cluster::{OnSlurm, cluster};
use super::support::records;

#[test]
fn a_check_tells_what_slurm_would_refuse_and_leaves_nothing_behind() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&[]);
    // Hidden ones too.
    let count = |sweep: &OnSlurm| std::fs::read_dir(sweep.place.path("")).map(Iterator::count).ok();
    let files = count(&sweep);
    let taken = sweep.check().exits(0).stdout();
    assert!(taken.contains(" in partition main") && taken.contains("fit"), "{taken}");
    let refused = sweep.with_profile("stages: {fit: {partition: nope}}");
    let said = refused.check().exits(2).stdout();
    assert!(said.contains("REFUSED  allocation failure: Invalid partition name"), "{said}");
    assert!(said.contains(" taken "), "the other steps: {said}");
    // This Slurm takes a time limit beyond the partition's, and never begins the job.
    let too_long = refused.with_profile("stages: {fit: {partition: low, time: 120}}");
    let said = too_long.check().exits(2).stdout();
    assert!(said.contains("time 120 is beyond partition low's 01:00:00: waits for ever"), "{said}");
    assert_eq!(count(&too_long), files);
}

#[test]
fn a_run_that_fails_keeps_the_fit_from_being_silent_and_the_others_from_nothing() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&[
        "train.lr={coefficient: 1e-14, params_exponent: 4, max: 1e9}",
        "grid.vocab=[16]",
        "grid.budgets=[1e9]",
    ]);
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!((&state["runs"]["done"], &state["runs"]["failed"]), (&1.into(), &1.into()));
    let log = sweep.logs();
    assert!(log.contains("incomplete: 1 of 2 runs are missing; failed: L2 d16"), "{log}");
    assert!(!sweep.results().join("laws.json").exists());
    // As on one machine: what failed is tried again only when asked.
    sweep.submit().exits(1).says("1 of 2 runs have no result");
    assert_eq!(records::bytes(&sweep.results()).len(), 1);
}

#[test]
fn what_waits_for_a_tokenizer_that_fails_leaves_the_queue() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&["tokenizer.lr=1e30", "grid.vocab=[16]"]);
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!(state["inputs"]["tokenizer"]["failed"], 1, "{}", sweep.logs());
    assert_eq!(state["runs"]["blocked"], 4);
    let text = sweep.place.isoflop(&["status", "results/mini"]).exits(0).stdout();
    assert!(text.contains("lower tokenizer.lr"), "{text}");
    assert!(text.contains("nothing in the queue"), "{text}");
    let log = sweep.logs();
    assert!(log.contains("incomplete: 4 of 4 runs are missing; failed: fsq"), "{log}");
}

#[test]
fn a_tokenizer_that_fails_holds_up_no_runs_of_another() {
    let Some(_cluster) = cluster() else { return };
    // The second tokenizer finds a folder where its metrics should be written.
    let sweep = OnSlurm::mini(&["grid.budgets=[1e9]"]);
    let plan = sweep.place.isoflop(&["plan", "mini.yaml", "--json"]).exits(0).json();
    let id = plan["tokenizers"][1]["tokenizer_id"].as_str().expect("an id");
    let failure = format!("results/mini/tokenizers/{id}/weights.safetensors");
    std::fs::create_dir_all(sweep.place.path(&failure)).expect("a writable directory");
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!((&state["runs"]["done"], &state["runs"]["blocked"]), (&2.into(), &2.into()));
}

#[test]
fn a_submission_that_is_cut_off_is_taken_up_and_not_made_twice() {
    let Some(_cluster) = cluster() else { return };
    for (killed_after, calls_in_all) in [(true, 3), (false, 4)] {
        let sweep = OnSlurm::mini(&["grid.vocab=[16]", "grid.budgets=[1e9]"]);
        sweep.place.write("sbatch.sh", wrapper(killed_after));
        let script = sweep.place.path("sbatch.sh");
        std::fs::set_permissions(&script, PermissionsExt::from_mode(0o755)).expect("ours");
        let sweep = sweep.with_profile(&format!("sbatch: {}", script.display()));
        // The wrapper kills the program at the second call, before or after the job is made.
        assert_eq!(sweep.submit_and_die(), 2);
        let ended = sweep.submit().exits(0);
        let calls = sweep.place.read("calls");
        let calls = String::from_utf8_lossy(&calls).lines().count();
        assert_eq!(calls, calls_in_all, "{}", ended.stdout());
        let state = sweep.over();
        assert_eq!(state["runs"]["done"], 2, "{}", sweep.logs());
        assert_eq!(sweep.jobs_done(), 5, "nothing was done twice:\n{}", sweep.logs());
        assert!(sweep.logs().contains("finished runs, laws.json"), "{}", sweep.logs());
        let tokens: BTreeSet<String> = sweep.tokens();
        assert_eq!(tokens.len(), sweep.place.names("results/mini/slurm/ledger").len());
    }
}

/// Notes each call; at the second one kills its caller, before or after it has called `sbatch`.
fn wrapper(after: bool) -> String {
    let die = "[ $(wc -l < calls) = 2 ] && kill -9 $PPID && exit 1";
    let (before, after) = if after { ("", die) } else { (die, "") };
    format!("#!/bin/bash\necho >> calls\n{before}\nsbatch \"$@\"\n{after}\ntrue\n")
}

impl OnSlurm {
    /// Submits with a program that is killed meanwhile; how often `sbatch` was called.
    fn submit_and_die(&self) -> usize {
        let words = ["run", "mini.yaml", "--engine", "slurm", "--profile", "profile.yaml"];
        let settings = ["--set", "grid.vocab=[16]", "--set", "grid.budgets=[1e9]"];
        let mut command = self.place.program(&[&words[..], &settings].concat());
        let status = command.status().expect("the binary can be started");
        assert_eq!(status.code(), None, "it was killed");
        String::from_utf8_lossy(&self.place.read("calls")).lines().count()
    }

    fn tokens(&self) -> BTreeSet<String> {
        let entry = |name| self.place.json(&format!("results/mini/slurm/ledger/{name}"));
        let names = self.place.names("results/mini/slurm/ledger");
        names.into_iter().map(|name| entry(name)["token"].to_string()).collect()
    }
}
