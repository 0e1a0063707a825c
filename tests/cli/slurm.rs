//! `isoflop run --engine slurm --dry-run`, which needs no Slurm, and mistakes in its section.

use super::support::Place;

const SECTION: &str = "
engine:
  slurm:
    partition: cpu
    account: motion
    time: 04:00:00
    cpus_per_task: 2
    mem: 4G
    array_parallel: 8
    flops_per_second: 1e8
    target_chunk_minutes: 1
    env: {DATA: /my data}
    preamble: [module load gcc]
    extra: [--mail-type=END]
    stages: {fit: {time: 10, cpus_per_task: 1}}
";

fn place() -> Place {
    let place = Place::with("mini.yaml");
    let sweep = String::from_utf8(place.read("mini.yaml")).expect("UTF-8");
    place.write("mini.yaml", sweep + SECTION);
    place
}

const DRY: [&str; 5] = ["run", "mini.yaml", "--engine", "slurm", "--dry-run"];

#[test]
fn a_dry_run_prints_every_call_and_script_and_changes_nothing() {
    let place = place();
    let ended =
        place.isoflop(&DRY).exits(0).says("1.00e8 FLOPs a second, as flops_per_second says");
    let here = place.path("").canonicalize().expect("it is there");
    let found = ended.stdout().replace(here.to_str().expect("UTF-8"), "/HERE");
    let golden = include_str!("../golden/slurm-dry-run.txt");
    let different = found.lines().zip(golden.lines()).find(|(now, then)| now != then);
    assert_eq!(different, None, "{found}");
    assert_eq!(found.lines().count(), golden.lines().count(), "{found}");
    assert!(!place.path("results").exists());
}

#[test]
fn a_profile_is_laid_over_the_sweep() {
    let place = place();
    place.write("site.yaml", "{partition: big, stages: {fit: {partition: small}}}\n");
    let words = [&DRY[..], &["--profile", "site.yaml", "--json"]].concat();
    let document = place.isoflop(&words).exits(0).json();
    let submissions = document["submissions"].as_array().expect("a list");
    let has = |at: usize, word: &str| {
        let words = submissions[at]["sbatch"].as_array().expect("words");
        words.iter().any(|one| one == word)
    };
    let last = submissions.len() - 1;
    assert!(has(0, "--partition=big") && has(0, "--account=motion"), "{document:#}");
    assert!(has(last, "--partition=small") && has(last, "--time=04:00:00"), "{document:#}");
}

#[test]
fn mistakes_in_the_section_and_the_profile_are_shown_where_they_stand() {
    let place = place();
    place.write("site.yaml", "partiton: big\ntime: soon\nextra: [--array=3]\n");
    let words = [&DRY[..], &["--profile", "site.yaml"]].concat();
    let ended = place.isoflop(&words).exits(2).says("did you mean `partition`?");
    ended.says("site.yaml:1:1").says("`soon` is no time limit").says("isoflop gives `--array`");
    let set = ["--set", "engine.slurm.mem_per_cpu=1G"];
    place.isoflop(&[&DRY[..], &set].concat()).exits(2).says("exclude one another");
    let set = ["--set", "engine.slurm.stages.fit.max_array=1"];
    place.isoflop(&[&DRY[..], &set].concat()).exits(2).says("unknown name `max_array`");
    let set = ["--set", "engine.slurm.env={A-B: 1}"];
    place.isoflop(&[&DRY[..], &set].concat()).exits(2).says("cannot name a variable");
}

#[test]
fn options_of_one_engine_are_refused_by_the_other() {
    let place = place();
    for option in [&["--dry-run"][..], &["--check"], &["--profile", "site.yaml"]] {
        let ended = place.isoflop(&[&["run", "mini.yaml"], option].concat()).exits(2);
        ended.says(&format!("{} wants --engine slurm", option[0]));
    }
    let fast = ["run", "mini.yaml", "--engine", "slurm", "--fail-fast"];
    place.isoflop(&fast).exits(2).says("--fail-fast is for this machine");
}

#[test]
fn a_machine_without_slurm_says_so_and_nothing_is_changed() {
    let place = place();
    let words = ["run", "mini.yaml", "--engine", "slurm"];
    let set = ["--set", "engine.slurm.scontrol=/no/such/scontrol"];
    let ended = place.isoflop(&[&words[..], &set].concat()).exits(2);
    ended.says("is this a machine with Slurm on it?").says("nothing was submitted or changed");
    let check = place.isoflop(&[&words[..], &set, &["--check"]].concat()).exits(2);
    check.says("is this a machine with Slurm on it?");
    assert!(!place.path("results").exists());
}

#[test]
fn with_a_card_each_task_of_the_runs_asks_for_one_gpu() {
    let place = place();
    let card =
        ["--set", "engine.gpu=h100", "--set", "engine.slurm.flops_per_second=null", "--json"];
    let ended = place.isoflop(&[&DRY[..], &card].concat()).exits(0);
    let document = ended.says("FLOPs a second, by the MFU of engine.gpu").json();
    for submission in document["submissions"].as_array().expect("a list") {
        let words = submission["sbatch"].as_array().expect("words");
        let name = words.iter().find_map(|word| word.as_str()?.strip_prefix("--job-name="));
        let trains = name.is_some_and(|name| name.contains("train"));
        assert_eq!(words.iter().any(|word| word == "--gres=gpu:1"), trains, "{submission:#}");
    }
}
