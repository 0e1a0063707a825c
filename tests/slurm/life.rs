//! What interrupts a sweep on a cluster: people, limits, other jobs, nodes that go away.

use std::time::Duration;

use nix::sys::signal::Signal;

use super::cluster::{OnSlurm, active, cluster};
use super::support::processes::kill_9;
use super::support::records;

/// Some seconds a run, and a checkpoint ten times per second.
const LONGER: [&str; 2] = ["grid.budgets=[8e9, 1.6e10]", "grid.vocab=[16]"];

fn assert_undisturbed(sweep: &OnSlurm) {
    let found = records::timeless(&sweep.results());
    assert_eq!(found.len(), 4, "{:#}\n{}", sweep.status(), sweep.logs());
    assert_eq!(found, records::timeless(&sweep.locally()));
    assert!(sweep.results().join("laws.json").exists(), "{}", sweep.logs());
}

#[test]
fn a_node_that_dies_costs_time_and_nothing_else() {
    let Some(cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&LONGER);
    sweep.submit().exits(0);
    sweep.at_work();
    cluster.kill_node(&cluster.node_at_work());
    let state = sweep.over();
    assert_eq!(state["runs"]["done"], 4, "{}", sweep.logs());
    assert_undisturbed(&sweep);
    cluster.heal();
}

#[test]
fn a_task_that_outlives_its_node_does_no_harm() {
    let Some(cluster) = cluster() else { return };
    // Long enough for Slurm to miss the node and to begin the task anew elsewhere meanwhile.
    let sweep = OnSlurm::mini(&["grid.budgets=[8e9, 1.5e11]", "grid.vocab=[16]"]);
    sweep.submit().exits(0);
    sweep.at_work();
    kill_9(cluster.daemon(&format!("slurmd-{}", cluster.node_at_work())));
    let state = sweep.over();
    assert_eq!(state["runs"]["done"], 4, "{}", sweep.logs());
    assert_undisturbed(&sweep);
    cluster.heal();
}

#[test]
fn a_cancelled_sweep_goes_on_where_it_stopped() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&LONGER);
    sweep.submit().exits(0);
    sweep.at_work();
    let ended = sweep.place.isoflop(&["cancel", "results/mini"]).exits(0);
    assert!(ended.stdout().starts_with("ended; finished jobs are kept"), "{}", ended.stdout());
    let state = sweep.status();
    assert_eq!(active(&state), Some(0));
    assert!(state["runs"]["done"].as_u64() < Some(4));
    assert!(!sweep.results().join("laws.json").exists(), "the fit is cancelled too");
    let nothing = sweep.place.isoflop(&["cancel", "results/mini"]).exits(0);
    assert!(nothing.stdout().starts_with("nothing is running here"));
    let before = sweep.jobs_done();
    sweep.submit().exits(0);
    sweep.over();
    assert_eq!(sweep.jobs_done(), before + 4 - state["runs"]["done"].as_u64().unwrap() as usize);
    assert_undisturbed(&sweep);
}

#[test]
fn a_warned_task_checkpoints_and_comes_back_by_itself() {
    let Some(cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&LONGER);
    sweep.submit().exits(0);
    sweep.at_work();
    let running = cluster.ask("squeue", &["-h", "-t", "running", "-o", "%F_%K"]);
    let task = running.lines().next().expect("a task is running").trim().to_string();
    cluster.ask("scancel", &["--batch", "--signal=USR2", &task]);
    sweep.over();
    assert!(sweep.logs().contains("back in the queue and goes on later"), "{}", sweep.logs());
    assert_eq!(sweep.place.names("results/mini/slurm/requeues").len(), 1);
    assert_undisturbed(&sweep);
}

/// Two minutes: Slurm looks at limits every half minute.
#[test]
#[ignore = "two minutes"]
fn a_time_limit_shorter_than_the_work_is_no_end() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&["grid.budgets=[1.2e11]", "grid.vocab=[16]"]);
    let sweep = sweep.with_profile("stages: {train: {time: 1}}, signal_grace_s: 45");
    sweep.submit().exits(0);
    sweep.over();
    assert!(sweep.logs().contains("back in the queue and goes on later"), "{}", sweep.logs());
    assert_eq!(records::timeless(&sweep.results()), records::timeless(&sweep.locally()));
}

#[test]
fn a_preempted_task_comes_back_by_itself() {
    let Some(cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&LONGER);
    sweep.place.write("profile.yaml", "{partition: low, time: 10, fs_grace_s: 2}\n");
    sweep.submit().exits(0);
    sweep.at_work();
    let urgent = ["--partition=main", "--nodes=2", "--exclusive", "--output=/dev/null"];
    cluster.ask("sbatch", &[&urgent[..], &["--wrap=sleep 1"]].concat());
    sweep.until("the preemption", |state| state["slurm"]["tasks_running"] == 0);
    sweep.over();
    assert_undisturbed(&sweep);
}

#[test]
fn a_second_call_while_tasks_run_submits_nothing() {
    let Some(_cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&["grid.budgets=[8e9]", "grid.vocab=[16]"]);
    sweep.submit().exits(0);
    let again = sweep.submit().exits(0);
    assert!(again.stdout().contains("in Slurm's queue already"), "{}", again.stdout());
    // An edit adds runs, which wait for the tokenizer that is in the queue.
    let wider = ["--set", "grid.budgets=[1e9, 8e9]", "--set", "grid.vocab=[16]"];
    let words = ["run", "mini.yaml", "--engine", "slurm", "--profile", "profile.yaml"];
    let wider = sweep.place.isoflop(&[&words[..], &wider].concat()).exits(0);
    assert!(wider.stdout().contains("2 jobs submitted"), "{}", wider.stdout());
    let state = sweep.over();
    assert_eq!((&state["runs"]["done"], sweep.jobs_done()), (&4.into(), 7), "{}", sweep.logs());
}

#[test]
fn a_dead_controller_is_not_an_empty_queue() {
    let Some(cluster) = cluster() else { return };
    let sweep = OnSlurm::mini(&LONGER);
    sweep.submit().exits(0);
    let pid = cluster.daemon("slurmctld");
    nix::sys::signal::kill(pid, Signal::SIGKILL).expect("the controller lives");
    let ended = sweep.submit().exits(2);
    ended.says("nothing was submitted or changed");
    let state = sweep.status();
    assert_eq!(state["slurm"]["known"], false);
    let text = sweep.place.isoflop(&["status", "results/mini"]).exits(0).stdout();
    assert!(text.contains("on Slurm: not known"), "{text}");
    sweep.place.isoflop(&["cancel", "results/mini"]).exits(2).says("asking Slurm");
    assert_eq!(sweep.place.names("results/mini/slurm/gen"), ["1"]);
    std::thread::sleep(Duration::from_secs(1));
    cluster.heal();
    sweep.over();
    // What a controller lost that was killed is submitted again.
    sweep.submit().exits(0);
    sweep.over();
    assert_undisturbed(&sweep);
}
