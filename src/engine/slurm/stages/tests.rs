//! Arrays of made-up jobs.

use super::*;
use proptest::prelude::*;

fn kind(word: &str) -> JobKind {
    word.parse().expect("a kind of job")
}

fn job(kind: JobKind, id: &str, seconds: f64, needs: &[(JobKind, &str)]) -> Job {
    Job {
        id: JobId::new(kind, id),
        label: id.to_string(),
        cost: seconds - 1.0,
        peak_bytes: 0,
        needs: needs.iter().map(|(kind, id)| JobId::new(*kind, *id)).collect(),
    }
}

/// Two tokenizers, the captions, and `runs` runs of ten seconds for each tokenizer.
fn sweep(runs: usize) -> Vec<Job> {
    let (text, tokens) = ((kind("text"), "text"), |t| (kind("tokens"), t));
    let mut jobs = vec![job(kind("text"), "text", 1.0, &[])];
    for t in ["a", "b"] {
        jobs.push(job(kind("tokenizer"), t, 9.0, &[]));
        jobs.push(job(kind("tokens"), t, 2.0, &[(kind("tokenizer"), t)]));
        let run = |i| job(kind("run"), &format!("{t}{i}"), 10.0, &[text, tokens(t)]);
        jobs.extend((0..runs).map(run));
    }
    jobs
}

fn lay_out(jobs: &[Job], section: &str, queued: &[(JobId, &str)], max: usize) -> Vec<Array> {
    let settings = Settings(serde_yaml::from_str(section).unwrap());
    let queued = queued.iter().map(|(id, task)| (id.clone(), task.to_string())).collect();
    arrays(
        jobs,
        &Layout {
            settings: &settings,
            estimates: &Estimates::given(1.0),
            reads: &|id| jobs.iter().find(|job| job.id == *id).unwrap().needs.clone(),
            queued: &queued,
            max_array: max,
            max_tasks: settings.max_submit(),
        },
    )
}

fn shape(arrays: &[Array]) -> Vec<(&str, Vec<usize>)> {
    let sizes = |array: &Array| array.chunks.iter().map(|chunk| chunk.jobs.len()).collect();
    arrays.iter().map(|array| (array.name.as_str(), sizes(array))).collect()
}

#[test]
fn a_tokenizer_has_a_task_and_its_runs_wait_for_it_and_the_captions_alone() {
    let arrays = lay_out(&sweep(12), "{}", &[], 1001);
    assert_eq!(
        shape(&arrays),
        [("inputs", vec![1, 2, 2]), ("train-1", vec![6, 6]), ("train-2", vec![6, 6])]
    );
    let after = |index| After::Ours { array: 0, index };
    assert_eq!(arrays[1].after, [after(0), after(1)]);
    assert_eq!(arrays[2].after, [after(0), after(2)]);
    assert_eq!(arrays[1].chunks[0].needs.len(), 2);
}

#[test]
fn a_run_that_others_wait_for_is_an_array_of_its_own_before_theirs() {
    let run = |id: &str, needs: &[(JobKind, &str)]| job(kind("run"), id, 10.0, needs);
    let mut jobs = vec![run("canary", &[])];
    jobs.extend((0..9).map(|i| run(&i.to_string(), &[(kind("run"), "canary")])));
    let arrays = lay_out(&jobs, "{target_chunk_minutes: 1}", &[], 1001);
    assert_eq!(shape(&arrays)[0], ("train-1", vec![1]));
    assert_eq!(arrays[0].after, []);
    let others = &arrays[1];
    assert_eq!(others.after, [After::Ours { array: 0, index: 0 }]);
    assert_eq!(others.chunks.iter().map(|chunk| chunk.jobs.len()).sum::<usize>(), 9);
    assert!(others.chunks.len() > 1, "runs that wait for one are not one unit");
    assert_eq!(others.chunks[0].needs, [JobId::run("canary")]);
}

#[test]
fn an_array_longer_than_slurm_takes_is_split() {
    let arrays = lay_out(&sweep(12), "{target_chunk_minutes: 0.2}", &[], 5);
    let names: Vec<&str> = arrays.iter().map(|array| array.name.as_str()).collect();
    assert_eq!(names[..4], ["inputs", "train-1", "train-2", "train-3"]);
    assert!(arrays.iter().all(|array| array.chunks.len() <= 5));
    assert_eq!(arrays.iter().flat_map(|array| &array.chunks).count(), 3 + 2 * 10);
}

#[test]
fn a_limit_of_tasks_makes_chunks_longer() {
    let section = "{target_chunk_minutes: 0.2, max_submit: 7}";
    let arrays = lay_out(&sweep(12), section, &[], 1001);
    assert!(arrays.iter().map(|array| array.chunks.len()).sum::<usize>() <= 7);
}

#[test]
fn trunks_stay_with_all_that_branches_off_them() {
    let trunk = |id, of: &[(JobKind, &str)]| job(kind("trunk"), id, 30.0, of);
    let run = |id, trunk| job(kind("run"), id, 30.0, &[(kind("trunk"), trunk)]);
    let jobs = [
        trunk("a1", &[]),
        trunk("a2", &[(kind("trunk"), "a1")]),
        trunk("b1", &[]),
        run("x", "a1"),
        run("y", "b1"),
        run("z", "a2"),
    ];
    let arrays = lay_out(&jobs, "{}", &[], 1001);
    assert_eq!(shape(&arrays), [("train", vec![4, 2])]);
    let ids = |i: usize| arrays[0].chunks[i].jobs.iter().map(|timed| timed.job.id.id.as_str());
    assert_eq!(ids(0).collect::<Vec<_>>(), ["a1", "a2", "x", "z"]);
}

#[test]
fn what_is_in_the_queue_is_waited_for_and_not_submitted_again() {
    let queued = [
        (JobId::new(kind("tokenizer"), "a"), "7_1"),
        (JobId::new(kind("tokens"), "a"), "7_1"),
        (JobId::new(kind("text"), "text"), "7_0"),
    ];
    let arrays = lay_out(&sweep(1), "{}", &queued, 1001);
    let names: Vec<&str> = arrays.iter().map(|array| array.name.as_str()).collect();
    assert_eq!(names, ["inputs", "train-1", "train-2"]);
    let queued = |task: &str| After::Queued(task.to_string());
    let b = After::Ours { array: 0, index: 0 };
    assert_eq!(arrays[1].after, [b, queued("7_0")]);
    assert_eq!(arrays[2].after, [queued("7_0"), queued("7_1")]);
}

#[test]
fn nothing_to_do_makes_no_array() {
    assert!(lay_out(&[], "{}", &[], 1001).is_empty());
}

#[test]
fn the_longest_come_first_and_bins_are_level() {
    let units = [3.0, 5.0, 2.0, 4.0, 2.0].map(|s| (s, s));
    assert_eq!(pack_chunks(units.to_vec(), 2), [vec![5.0, 2.0, 2.0], vec![4.0, 3.0]]);
}

#[test]
fn a_small_sweep_is_spread_and_a_large_one_fills_its_tasks() {
    assert_eq!(length_s(600.0, 1800.0, None), 60.0);
    assert_eq!(length_s(6.0 * 3600.0, 1800.0, None), 450.0);
    assert_eq!(length_s(6.0 * 3600.0, 1800.0, Some(2)), 1800.0);
    assert_eq!(length_s(600.0, 3.0, None), 3.0);
    assert_eq!(count(&[50.0, 50.0, 50.0], 60.0), 3);
    assert_eq!(count(&[1.0; 100], 60.0), 2);
    assert_eq!(count(&[500.0], 60.0), 1);
}

proptest! {
    #[test]
    fn every_unit_is_in_one_bin_and_no_bin_is_far_too_full(
        seconds in prop::collection::vec(0.1f64..100.0, 1..60), bins in 1usize..12,
    ) {
        let units: Vec<(f64, usize)> = seconds.iter().copied().zip(0..).collect();
        let packed = pack_chunks(units, bins);
        let mut all: Vec<usize> = packed.iter().flatten().copied().collect();
        all.sort_unstable();
        prop_assert_eq!(all, (0..seconds.len()).collect::<Vec<_>>());
        let load = |bin: &Vec<usize>| bin.iter().map(|i| seconds[*i]).sum::<f64>();
        let fullest = packed.iter().map(load).fold(0.0, f64::max);
        let longest = seconds.iter().copied().fold(0.0, f64::max);
        let fair = seconds.iter().sum::<f64>() / bins as f64;
        prop_assert!(fullest <= fair + longest + 1e-9);
    }
}
