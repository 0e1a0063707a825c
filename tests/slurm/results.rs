//! What comes of a sweep on Slurm is what comes of it on one machine, bit for bit.

use super::cluster::{OnSlurm, cluster};
use super::support::{Place, records};

/// The whole of what a sweep makes, but for what a clock or a meter measured.
fn assert_same(sweep: &OnSlurm) {
    let (ours, theirs) = (sweep.results(), sweep.locally());
    assert_eq!(records::timeless(&ours), records::timeless(&theirs));
    assert_eq!(records::timeless_table(&ours), records::timeless_table(&theirs));
    for file in ["laws.json", "prediction.json", "figures/loss_vs_flops.svg"] {
        let read = |folder: &std::path::Path| std::fs::read(folder.join(file)).expect(file);
        assert_eq!(read(&ours), read(&theirs), "{file}");
    }
}

#[test]
fn a_sweep_on_slurm_gives_the_bits_of_one_on_this_machine() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&[]);
    let submitted = sweep.submit().exits(0);
    assert!(submitted.stdout().contains("13 jobs submitted"), "{}", submitted.stdout());
    let state = sweep.over();
    assert_eq!((&state["runs"]["done"], sweep.jobs_done()), (&8.into(), 13), "{}", sweep.logs());
    assert_same(&sweep);
    // The same command again trains nothing and says what was found.
    sweep.submit().exits(0).does_not_say("submitted");
    assert_eq!(sweep.place.names("results/mini/slurm/gen"), ["1"]);
}

#[test]
fn tokenizers_with_language_and_generators_as_an_axis_give_the_same_bits_on_slurm() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::language();
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!(state["runs"]["done"], 16, "{state:#}\n{}", sweep.logs());
    let (ours, theirs) = (sweep.results(), sweep.locally());
    assert_eq!(records::timeless(&ours), records::timeless(&theirs));
    assert_eq!(records::timeless_table(&ours), records::timeless_table(&theirs));
    for generator in ["autoregressive", "scalewise"] {
        let laws = format!("generators/{generator}/laws.json");
        let read = |folder: &std::path::Path| std::fs::read(folder.join(&laws)).expect("laws");
        assert_eq!(read(&ours), read(&theirs), "{generator}");
    }
}

#[test]
fn evaluators_and_scores_are_the_same_on_slurm() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::scored();
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!(state["runs"]["done"], 4, "{state:#}\n{}", sweep.logs());
    let (ours, theirs) = (sweep.results(), sweep.locally());
    assert_eq!(records::timeless(&ours), records::timeless(&theirs));
    assert_eq!(records::timeless_scores(&ours), records::timeless_scores(&theirs));
    for file in ["scores.csv", "figures/quality.svg"] {
        let read = |folder: &std::path::Path| std::fs::read(folder.join(file)).expect(file);
        assert_eq!(read(&ours), read(&theirs), "{file}");
    }
}

/// The whole study, with one of the two nodes gone for good when a third of the runs are done.
#[test]
#[ignore = "a quarter of an hour"]
fn the_quickstart_gives_the_same_bits_with_a_node_killed_in_the_middle() {
    let Some(cluster) = cluster() else { return };
    let sweep = OnSlurm::quickstart();
    sweep.submit().exits(0);
    let third = |state: &serde_json::Value| state["runs"]["done"].as_u64() >= Some(47);
    sweep.until("a third of the runs", third);
    sweep.at_work();
    let node = cluster.node_at_work();
    cluster.kill_node(&node);
    sweep.until("Slurm's word of the loss", |_| cluster.is_down(&node));
    let state = sweep.over();
    assert_eq!(state["runs"]["done"], 141, "{state:#}\n{}", sweep.logs());
    assert!(cluster.is_down(&node), "it came back by itself");
    assert_same(&sweep);
    cluster.heal();
}

#[test]
fn shared_trunks_stay_with_their_runs_and_give_the_same_bits() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&[
        "train.schedule.kind=wsd",
        "train.schedule.share=true",
        "grid.budgets=[1e9, 1.5e9, 2.2e9]",
        "engine.slurm.cpus_per_task=2",
    ]);
    sweep.submit().exits(0);
    let state = sweep.over();
    assert_eq!(state["inputs"]["trunk"]["done"], 12, "{}", sweep.logs());
    assert_same(&sweep);
}

#[test]
fn arrays_longer_than_slurm_takes_are_split() {
    let Some(cluster) = cluster() else { return };
    let said = cluster.ask("scontrol", &["show", "config"]);
    let line = said.lines().find(|line| line.starts_with("MaxArraySize")).expect("it is said");
    assert!(line.ends_with("= 5"), "{line}");
    let sweep = OnSlurm::mini(&["seeds=[0, 1]", "grid.budgets=[1e9]", "grid.vocab=[16]"]);
    let sweep = sweep.with_profile("target_chunk_minutes: 0.001, max_array: 3");
    sweep.submit().exits(0);
    let arrays = sweep.place.names("results/mini/slurm/ledger");
    assert_eq!(arrays, ["1-fit.json", "1-inputs.json", "1-train-1.json", "1-train-2.json"]);
    assert_eq!(sweep.over()["runs"]["done"], 4);

    let sweep = OnSlurm::mini(&["seeds=[0, 1, 2]", "grid.budgets=[1e9]", "grid.vocab=[16]"]);
    let sweep = sweep.with_profile("target_chunk_minutes: 0.001");
    sweep.submit().exits(0);
    assert_eq!(sweep.place.names("results/mini/slurm/gen/1/train-1").len(), 5);
    assert_eq!(sweep.place.names("results/mini/slurm/gen/1/train-2").len(), 1);
    assert_eq!(sweep.over()["runs"]["done"], 6);
}

#[test]
fn odd_paths_and_a_hostile_environment_change_nothing() {
    let Some(_cluster) = cluster() else { return };
    let outer = Place::new();
    let odd = outer.path("50 %A it's %j");
    std::fs::create_dir(&odd).expect("a writable directory");
    let sweep = include_str!("../sweeps/mini.yaml");
    std::fs::write(odd.join("mini.yaml"), sweep).expect("a writable directory");
    let profile = "{partition: main, fs_grace_s: 2, env: {ODD: \"a 'b' $c\"}}\n";
    std::fs::write(odd.join("profile.yaml"), profile).expect("a writable directory");
    let words = ["run", "mini.yaml", "--engine", "slurm", "--profile", "profile.yaml"];
    let mut command = outer.program(&words);
    command.args(["--set", "grid.budgets=[1e9]"]).current_dir(&odd);
    let hostile = [
        ("SBATCH_PARTITION", "nowhere"),
        ("SBATCH_WAIT", "1"),
        ("SBATCH_OUTPUT", "/nowhere/%j"),
        ("SBATCH_ERROR", "/nowhere/%j"),
        ("SBATCH_ARRAY_INX", "7"),
    ];
    let output = command.envs(hostile).output().expect("the binary can be started");
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{stderr}");
    assert!(stderr.contains("SBATCH_PARTITION is set in this shell"), "{stderr}");
    let results = odd.join("results/mini");
    let results = results.to_str().expect("UTF-8");
    let ended = super::support::processes::wait_for(std::time::Duration::from_secs(60), || {
        std::thread::sleep(std::time::Duration::from_millis(300));
        let state = outer.isoflop(&["status", results, "--json"]).exits(0).json();
        (super::cluster::active(&state) == Some(0)).then_some(state)
    });
    assert_eq!(ended.expect("an end")["runs"]["done"], 4);
    let logs = std::fs::read_dir(odd.join("results/mini/slurm/logs")).expect("the logs are there");
    assert_eq!(logs.count(), 6);
}
