//! Memory: no more is started than fits, and what is refused it runs again with more to itself.

use std::fs;
use std::os::unix::process::CommandExt;

use nix::sys::resource::{Resource, setrlimit};

use super::super::support::Ended;
use super::*;

/// The stretches of the last scheduler of a folder.
fn stretches(place: &Place, results: &str) -> Vec<Value> {
    let text = String::from_utf8(place.read(&format!("{results}/schedule.jsonl"))).expect("text");
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}

fn overlap(one: &Value, other: &Value) -> bool {
    let at = |stretch: &Value, name: &str| stretch[name].as_f64().expect("seconds");
    at(one, "start_s") < at(other, "end_s") && at(other, "start_s") < at(one, "end_s")
}

#[test]
fn jobs_that_do_not_fit_beside_one_another_run_one_after_another() {
    let place = Place::with("mini.yaml");
    let args = ["run", "mini.yaml", "--jobs", "4", "--memory", "1MB"];
    place.isoflop(&args).exits(0).says("and there are 0.0 GB: it runs alone");
    assert_undisturbed(&place.path("results/mini"));
    let ran = stretches(&place, "results/mini");
    assert!(ran.len() >= 13 && ran.iter().all(|one| one["end"] == "done"), "{ran:?}");
    for (i, one) in ran.iter().enumerate() {
        assert!(!ran[..i].iter().any(|other| overlap(one, other)), "{one}");
    }
    let command = place.json("results/mini/command.json").to_string();
    assert!(command.contains("--memory"), "{command}");
    place.isoflop(&["run", "mini.yaml", "--memory", "lots"]).exits(2).says("--memory");
}

#[test]
fn a_worker_that_is_refused_memory_is_told_from_one_that_is_killed() {
    let place = Place::with("mini.yaml");
    // A model of 1.2 GB with its gradients and moments, and half of that to have it in.
    let large = [
        "--set",
        "grid.models=[{n_layer: 6, n_head: 8, d_model: 1024}]",
        "--set",
        "grid.vocab=[16]",
        "--set",
        "grid.budgets=[1e12]",
        "--set",
        "train.min_steps=1",
        "--jobs",
        "1",
    ];
    let args = [&["run", "mini.yaml"], &large[..]].concat();
    let mut command = place.program(&args);
    let limit = 700_000_000;
    // SAFETY: between fork and exec only the limit is set, which is async-signal-safe.
    unsafe {
        command.pre_exec(move || Ok(setrlimit(Resource::RLIMIT_AS, limit, limit)?));
    }
    let ended = Ended::of(&args, command.output().expect("the binary can be started")).exits(1);
    ended.says("[out-of-memory]").says("it is started again when nothing runs beside it");
    let failure = only_failure(&place, "results/mini");
    assert_eq!(failure["failure"], "out-of-memory");
    assert!(failure["last_lines"].to_string().contains("memory allocation of"), "{failure}");
}

/// A control group of a test's own that may use so much memory; gone with the value.
struct Group(PathBuf);

impl Group {
    fn limited(bytes: u64) -> Option<Self> {
        let name = format!("isoflop-test-{}", std::process::id());
        for (tree, limit) in [("memory", "memory.limit_in_bytes"), ("", "memory.max")] {
            let group = Path::new("/sys/fs/cgroup").join(tree).join(&name);
            if fs::create_dir(&group).is_err() {
                continue;
            }
            let group = Self(group);
            let limited = fs::write(group.0.join(limit), bytes.to_string());
            // Without swap, where the kernel counts it.
            let _ = fs::write(group.0.join("memory.memsw.limit_in_bytes"), bytes.to_string());
            let _ = fs::write(group.0.join("memory.swap.max"), "0");
            if limited.is_ok() {
                println!("ran in a control group: {}", group.0.display());
                return Some(group);
            }
        }
        println!("NOT RUN: this machine does not let tests make control groups for memory");
        None
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        wait_for(PATIENCE, || fs::remove_dir(&self.0).is_ok().then_some(()));
    }
}

#[test]
fn a_program_that_the_kernel_kills_for_memory_runs_again_alone() {
    let Some(group) = Group::limited(245_000_000) else { return };
    let place = Place::new();
    place.write("own.yaml", OWN.replace("budgets: [1e9]", "budgets: [1e9, 2e9]"));
    // 80 MB each, and twice that for a moment: room for one and not for two. Held until the other
    // has them too, or does not come.
    let script = r#"held=$(head -c 80000000 /dev/zero | tr '\0' x)
touch "$3/holds"; n=0
while [ $(ls -d results/own/runs/*/checkpoint/holds | wc -l) -lt 2 ] && [ $n -lt 40 ]; do
  sleep 0.1; n=$((n + 1))
done
sleep 0.5
echo '{"loss_nats": 1, "loss_normalised": 1}' > "$2""#;
    place.write("train.sh", script);
    // Side by side from the first, without one that goes before.
    let args = ["run", "own.yaml", "--jobs", "2", "--set", "trainer.canary=false"];
    let mut command = place.program(&args);
    let processes = group.0.join("cgroup.procs");
    // SAFETY: between fork and exec the child only writes its number to a file.
    unsafe {
        command.pre_exec(move || fs::write(&processes, std::process::id().to_string()));
    }
    let ended = Ended::of(&args, command.output().expect("the binary can be started"));
    let ended = ended.says("it is started again when nothing runs beside it");
    // Both have their result; laws of one shape cannot be fitted, which is another matter.
    assert_eq!(records::bytes(&place.path("results/own")).len(), 2, "{}", ended.stderr());
    let ran = stretches(&place, "results/own");
    assert!(ran.iter().any(|one| one["end"] == "out-of-memory"), "{ran:?}");
}
