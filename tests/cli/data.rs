//! `isoflop data`: other files into a data set, its check, its numbers.

use isoflop::motion::Pose;
use isoflop::motion::bvh::fit_bvh;
use isoflop::motion::synth::Script;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::support::Place;

/// The first frames of a motion that has as many.
fn motion(seed: u64, n: usize) -> Vec<Pose> {
    let scripts =
        (0..).map(|i| Script::sample(&mut ChaCha8Rng::seed_from_u64(1000 * seed + i)).poses());
    let mut long = scripts.filter(|poses| poses.len() >= n);
    long.next().expect("a long motion comes")[..n].to_vec()
}

/// Twelve captures of six names at 20 frames per second.
fn captures(place: &Place) {
    std::fs::create_dir(place.path("captures")).expect("a writable directory");
    for (i, name) in ["walk", "run", "bow", "jump", "turn", "kick"].iter().enumerate() {
        for take in 1..=2u64 {
            let poses = motion(i as u64 + 100 * take, 101 + 10 * i);
            let text = fit_bvh(&poses, 20.0).expect("a motion").bvh.to_string();
            place.write(&format!("captures/{name}_{take:02}.bvh"), text);
        }
    }
}

#[test]
fn two_commands_lead_from_bvh_to_trained_runs() {
    let place = Place::new();
    captures(&place);
    let import = ["data", "import", "captures", "--from", "bvh", "--out", "data/mine"];
    let said = place.isoflop(&import).exits(0).stdout();
    assert!(said.starts_with("12 clips") && said.contains("data/mine/contact.png"), "{said}");
    assert!(said.contains("isoflop run own-data --set data.path=data/mine"), "{said}");
    assert!(said.lines().all(|line| line.chars().count() <= 80), "{said}");
    place.isoflop(&import).exits(2).says("data/mine is there already");
    let again = place.isoflop(&[&import[..], &["--overwrite", "--json"]].concat()).exits(0).json();
    let clips = ["train", "val", "test"].map(|split| again[split]["clips"].as_u64().unwrap_or(0));
    assert!(clips.iter().all(|n| *n >= 2) && clips.iter().sum::<u64>() == 12, "{clips:?}");
    assert_eq!(again["skeletons"][0]["joints"]["left_knee"], "left_knee");
    place.isoflop(&["data", "check", "data/mine"]).exits(0);
    let stats = place.isoflop(&["data", "stats", "data/mine", "--json"]).exits(0).json();
    assert_eq!(stats["counted"]["all"]["clips"], 12);
    let small = ["tokenizer.steps=2", "grid.budgets=[2e7]", "grid.vocab=[16]", "train.min_steps=1"];
    let models = "grid.models=[{n_layer: 1, n_head: 1, d_model: 4}]";
    let mut run = vec!["run", "own-data", "--set", "data.path=data/mine", "--set", models];
    small.iter().for_each(|setting| run.extend(["--set", setting]));
    let said = place.isoflop(&run).exits(0).stdout();
    assert!(said.contains("own-data: 1 finished runs"), "{said}");
}

#[test]
fn a_file_that_cannot_be_used_is_told_and_a_mapping_mends_it() {
    let place = Place::new();
    captures(&place);
    let good = String::from_utf8(place.read("captures/bow_01.bvh")).expect("UTF-8");
    place.write("captures/bow_01.bvh", good.replace("left_knee", "joint_07"));
    let import = ["data", "import", "captures", "--from", "bvh", "--out", "mine"];
    place
        .isoflop(&import)
        .exits(1)
        .says("bow_01.bvh: has no joint that is clearly the left_knee")
        .says("a draft of a mapping is mine.map.yaml");
    let draft = String::from_utf8(place.read("mine.map.yaml")).expect("UTF-8");
    place.write("map.yaml", "left_knee: joint_07\n");
    assert!(draft.contains("# left_knee: \n") && draft.contains("#   joint_07"), "{draft}");
    let wrong = [&import[..], &["--overwrite", "--map", "mine.map.yaml"]].concat();
    place.isoflop(&wrong).exits(1);
    place.write("wrong.yaml", "left_nee: joint_07\n");
    let wrong = [&import[..], &["--overwrite", "--map", "wrong.yaml"]].concat();
    place.isoflop(&wrong).exits(2).says("the skeleton has no \"left_nee\"");
}

#[test]
fn synthetic_motion_is_a_sound_data_set_and_a_broken_one_is_told() {
    let place = Place::new();
    let synth = ["data", "synth", "--out", "made", "--clips", "6", "--val-clips", "3"];
    place.isoflop(&[&synth[..], &["--test-clips", "4"]].concat()).exits(0);
    place.isoflop(&["data", "check", "made"]).exits(0);
    place.write("made/texts/train-000001.txt", "a#b#c\n");
    place.write("made/new_joint_vecs/test-000002.npy", "no array");
    let found = place.isoflop(&["data", "check", "made"]).exits(1).stdout();
    assert!(
        found.contains("texts/train-000001.txt") && found.contains("test-000002.npy"),
        "{found}"
    );
    let found = place.isoflop(&["data", "check", "made", "--json"]).exits(1).json();
    assert_eq!(found["problems"].as_array().map(Vec::len), Some(3), "{found}");
}

#[test]
fn a_sweep_is_sized_to_the_data_and_the_time() {
    let place = Place::new();
    let synth = ["data", "synth", "--out", "made", "--clips", "40", "--val-clips", "4"];
    place.isoflop(&[&synth[..], &["--test-clips", "4"]].concat()).exits(0);
    let checked = place.isoflop(&["data", "check", "made"]).exits(0).stdout();
    assert!(
        checked.contains("0 problems") && checked.contains("codes: the mean loss"),
        "{checked}"
    );
    let init = ["init", "study.yaml", "--data", "made", "--hours", "100"];
    let ended = place.isoflop(&init).exits(0).says("the laws describe repeated data");
    let said = ended.says("small-test: the test split holds about").stdout();
    assert!(said.contains("next     isoflop run study.yaml"), "{said}");
    let text = String::from_utf8(place.read("study.yaml")).expect("UTF-8");
    assert!(
        text.contains("seeds: [0, 1, 2]")
            && text.contains("steps: 800, seeds: [0, 1, 2]")
            && text.contains("path: \"made\""),
        "{text}"
    );
    let plan = place.isoflop(&["plan", "study.yaml", "--json"]).exits(0).json();
    let runs = plan["runs"].as_array().expect("runs");
    let budgets: std::collections::BTreeSet<String> =
        runs.iter().map(|run| run["budget_flops"].to_string()).collect();
    assert_eq!(budgets.len(), 5, "{budgets:?}");
    place.isoflop(&init).exits(2).says("study.yaml is there already");
    let quick = ["init", "quick.yaml", "--hours", "0.2", "--json"];
    let offer = place.isoflop(&quick).exits(0).json();
    assert!(offer["hours"].as_f64().is_some_and(|hours| hours > 0.0), "{offer}");
    assert!(offer["bound_by"].as_str().is_some_and(|said| said.contains("--hours")), "{offer}");
    place.isoflop(&["plan", "quick.yaml"]).exits(0);
    place.isoflop(&["init", "a.yaml", "--hours=-1"]).exits(2).says("hours are above 0");
}

#[test]
fn a_data_set_keeps_the_rate_of_its_files() {
    let place = Place::new();
    captures(&place);
    let import = ["data", "import", "captures", "--from", "bvh", "--out", "data/kept"];
    let import = |more: &[&str]| place.isoflop(&[&import[..], more].concat());
    let said = import(&["--rate", "keep", "--json"]).exits(0).json();
    assert_eq!(said["fps"], 20.0);
    let faster = place.read("captures/bow_01.bvh");
    let faster =
        String::from_utf8(faster).expect("UTF-8").replace("Frame Time: 0.05", "Frame Time: 0.025");
    place.write("captures/bow_01.bvh", faster);
    let slip = import(&["--rate", "keep", "--overwrite"]).exits(2);
    slip.says("40 and of 20 frames a second").says("--rate 40");
    let said = import(&["--rate", "40", "--overwrite", "--json"]).exits(0).json();
    assert_eq!(said["fps"], 40.0);
    let stats = place.isoflop(&["data", "stats", "data/kept", "--json"]).exits(0).json();
    assert_eq!(stats["counted"]["fps"], 40.0);
    let plan = ["plan", "own-data", "--set", "data.path=data/kept", "--set", "data.fps=30"];
    place.isoflop(&plan).says("40 frames a second, where data.fps is 30");
}
