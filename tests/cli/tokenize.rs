//! `isoflop tokenize` and `isoflop detokenize`.

use std::fs;

use isoflop::codes::TokenStore;
use isoflop::data::{MotionSource, Procedural, ProceduralOptions, Split, write_npy};
use isoflop::motion::bvh::fit_bvh;
use isoflop::motion::{N_FEATURES, Pose, build_features};
use serde_json::Value;

use super::support::Place;

/// The motion of `tests/sweeps`.
fn motion() -> Procedural {
    let (train_clips, val_clips, test_clips) = (16, 8, 16);
    Procedural::new(ProceduralOptions { seed: 0, train_clips, val_clips, test_clips })
}

/// The test split as files `truth/<i>.npy`, each with its first caption beside it.
fn write_test_split(place: &Place) -> Vec<String> {
    let source = motion();
    let write = |i: usize| {
        let features = source.features(Split::Test, i).expect("it is made on demand");
        let name = format!("truth/{i}.npy");
        let shape = [features.len() / N_FEATURES, N_FEATURES];
        write_npy(&place.path(&name), &shape, &features).expect("a writable directory");
        let caption = &source.captions(Split::Test, i)[0];
        place.write(&format!("truth/{i}.txt"), format!("{caption}#a/DET#0.0#0.0\n"));
        name
    };
    (0..source.n_clips(Split::Test)).map(write).collect()
}

/// The words of a command on all the files.
fn words<'a>(command: &'a str, files: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    [command]
        .into_iter()
        .chain(files.iter().map(String::as_str))
        .chain(more.iter().copied())
        .collect()
}

fn trained(sweep: &str, settings: &[&str]) -> (Place, String) {
    let place = Place::with(sweep);
    place.isoflop(&[&["tokenizer", "train", sweep], settings].concat()).exits(0);
    let name = sweep.trim_end_matches(".yaml");
    let id = place.names(&format!("results/{name}/tokenizers")).remove(0);
    (place, format!("results/{name}/tokenizers/{id}"))
}

fn json_names(place: &Place, folder: &str) -> Vec<String> {
    place.names(folder).iter().map(|name| format!("{folder}/{name}")).collect()
}

#[test]
fn codes_are_those_of_the_data_set_and_their_error_is_that_of_the_metrics() {
    for sweep in ["mini.yaml", "multiscale.yaml", "residual.yaml"] {
        let place = Place::with(sweep);
        place.isoflop(&["run", sweep]).exits(0);
        let name = sweep.trim_end_matches(".yaml");
        let files = write_test_split(&place);
        let run = format!("results/{name}");
        place.isoflop(&words("tokenize", &files, &["--run", &run, "--out", "codes"])).exits(0);
        let first = place.json("codes/0.json");
        let id = first["tokenizer_id"].as_str().expect("an id");
        let own = format!("{run}/tokenizers/{id}");
        let store = place.path(&format!("{own}/tokens/codes.safetensors"));
        let store = TokenStore::open(&store).expect("the run read it");
        for i in 0..files.len() {
            let clip = place.json(&format!("codes/{i}.json"));
            let codes: Vec<u32> = serde_json::from_value(clip["codes"].clone()).expect("codes");
            assert_eq!(store.clip(Split::Test, i), codes, "{sweep}, clip {i}");
            assert_eq!(clip["frames"], store.clip_frames(Split::Test, i));
            let n: u64 = clip["scales"].as_array().expect("scales").iter().map(codes_of).sum();
            assert_eq!((n, &clip["fps"]), (codes.len() as u64, &20.0.into()));
        }
        let codes: Vec<String> = (0..files.len()).map(|i| format!("codes/{i}.json")).collect();
        let more = ["--tokenizer", &own, "--truth", "truth", "--out", "made", "--json"];
        let made = place.isoflop(&words("detokenize", &codes, &more)).exits(0).json();
        let expected = place.json(&format!("{own}/metrics.json"))["mpjpe_mm"].as_f64();
        let [found, expected] = [made["mpjpe_mm"].as_f64(), expected].map(|mm| mm.expect("mm"));
        assert!((found / expected - 1.0).abs() < 1e-4, "{sweep}: {found} for {expected}");
        assert_eq!(place.names("made").len(), 5 * files.len());
    }
}

fn codes_of(scale: &Value) -> u64 {
    scale["n_codes"].as_u64().expect("a number")
}

#[test]
fn tokenizing_twice_gives_the_same_bytes_and_other_forms_of_a_motion_nearly_its_codes() {
    let (place, own) = trained("mini.yaml", &[]);
    let files = write_test_split(&place);
    let tokenize = |files: &[String], out: &str| {
        place.isoflop(&words("tokenize", files, &["--tokenizer", &own, "--out", out])).exits(0)
    };
    let text = tokenize(&files[..3], "a").stdout();
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    tokenize(&files[..3], "b");
    assert_eq!(place.read("a/2.json"), place.read("b/2.json"));
    let more = ["--tokenizer", &own, "--out", "made"];
    let text = place.isoflop(&words("detokenize", &["a/2.json".into()], &more)).exits(0).stdout();
    assert!(text.contains("no original lies beside the codes"), "{text}");
    assert!(!text.contains("pinned"), "{text}");
    let more = ["--tokenizer", &own, "--out", "cleaned", "--clean-feet"];
    let text = place.isoflop(&words("detokenize", &["a/2.json".into()], &more)).exits(0).stdout();
    assert!(text.contains(" pinned") && text.contains("jerk"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    for form in ["made/2.features.npy", "made/2.joints.npy", "made/2.bvh"] {
        let out = form.replace(['/', '.'], "-");
        tokenize(&[form.to_string()], &out);
        let clip = place.json(&format!("{out}/2.json"));
        let lost = if form.contains("features") { 0 } else { 4 };
        let frames = place.json("a/2.json")["frames"].as_u64().expect("frames");
        assert_eq!(clip["frames"], frames - lost, "joints have one step less than frames");
    }
}

/// The settings of a small tokenizer that sees captions.
const LANGUAGE: [&str; 2] = [
    "--set",
    "tokenizer={kind: transformer, width: 8, layers: 1, heads: 2, latent: 4, window: 32, steps: 4, \
     batch: 2, pool_clips: 8, language: {}, quantizer: {kind: multiscale, scales: [1, 2, 4]}}",
];

#[test]
fn a_tokenizer_with_language_reads_captions_from_where_they_are() {
    let (place, own) = trained("multiscale.yaml", &LANGUAGE);
    let files = write_test_split(&place);
    let tokenize = |more: &[&str]| {
        let more = [&["--tokenizer", own.as_str()], more].concat();
        place.isoflop(&words("tokenize", &files[..2], &more))
    };
    tokenize(&["--out", "beside"]).exits(0);
    let captions = [0, 1].map(|i| motion().captions(Split::Test, i)[0].clone());
    assert_eq!(place.json("beside/1.json")["caption"], captions[1].as_str());
    place.write("texts", format!("\n{}\n{}\n", captions[0], captions[1]));
    tokenize(&["--out", "lines", "--texts", "texts"]).exits(0);
    assert_eq!(place.read("lines/1.json"), place.read("beside/1.json"));
    tokenize(&["--out", "one", "--caption", "  Somebody   JUMPS "]).exits(0);
    fs::remove_file(place.path("truth/1.txt")).expect("it is there");
    tokenize(&["--out", "none"]).exits(2).says("give --caption, --texts, or a .txt beside it");
    assert!(!place.path("none").exists(), "nothing is written of the motion before it");
    place.write("texts", "one\n");
    tokenize(&["--out", "none", "--texts", "texts"]).exits(2).says("1 captions for 2 motions");
    place.write("truth/1.txt", "he sits##0.5#1.0\n");
    tokenize(&["--out", "none"]).exits(2).says("has no caption of the whole motion");

    let detokenize = |more: &[&str]| {
        let more = [&["--tokenizer", own.as_str(), "--truth", "truth"], more].concat();
        let codes = json_names(&place, "beside");
        place.isoflop(&words("detokenize", &codes, &more)).exits(0);
    };
    detokenize(&["--out", "plain"]);
    detokenize(&["--out", "guided", "--detokenizer-guidance", "2"]);
    assert_ne!(place.read("plain/1.features.npy"), place.read("guided/1.features.npy"));
}

#[test]
fn what_cannot_be_tokenized_is_told_and_nothing_is_written() {
    let (place, own) = trained("mini.yaml", &[]);
    let files = write_test_split(&place);
    let refused = |files: &[&str], more: &[&str], sentence: &str| {
        let more = [&["--tokenizer", own.as_str(), "--out", "out"], more].concat();
        let ended = place.isoflop(&[&["tokenize"], files, &more].concat()).exits(2);
        ended.says(sentence);
        assert!(!place.path("out").exists());
    };
    let array = |name: &str, shape: &[usize], value: f32| {
        let values = vec![value; shape.iter().product()];
        write_npy(&place.path(name), shape, &values).expect("a writable directory");
    };
    array("short.npy", &[3, 263], 0.5);
    array("kit.npy", &[40, 251], 0.5);
    array("nan.npy", &[40, 263], f32::NAN);
    refused(&["short.npy"], &[], "has 3 frames, and the tokenizer reads 4 or more");
    refused(&["truth/0.npy", "kit.npy"], &[], "kit.npy: has shape [40, 251] where [frames, 263]");
    refused(&["nan.npy"], &[], "nan.npy: holds a number that is not finite, the first at [0, 0]");
    refused(&["mini.yaml"], &[], "mini.yaml: is no motion that can be read");
    refused(&["truth"], &[], "truth: ");
    refused(&["absent.npy"], &[], "cannot read absent.npy");
    fs::create_dir(place.path("other")).expect("a writable directory");
    fs::copy(place.path(&files[0]), place.path("other/0.npy")).expect("it is there");
    refused(&["truth/0.npy", "other/0.npy"], &[], "would both become out/0.json");
    refused(&["truth/0.npy"], &["--texts", "absent"], "reading absent");
    refused(&["truth/0.npy"], &["--caption", " "], "--caption is empty");
    refused(&["truth/0.npy"], &["--run", "results/mini"], "cannot be used with");
    let without = ["tokenize", "truth/0.npy", "--out", "out"];
    place.isoflop(&without).exits(2).says("--run <RUN>|--tokenizer <FOLDER>");
    let elsewhere = [&without[..], &["--tokenizer", "results/mini"]].concat();
    place.isoflop(&elsewhere).exits(2).says("holds no trained tokenizer");
    let unfinished = [&without[..], &["--run", "results/mini"]].concat();
    place.isoflop(&unfinished).exits(2).says("has no finished run with weights");
}

#[test]
fn a_motion_in_other_units_axes_or_sides_is_told_by_name() {
    let (place, own) = trained("mini.yaml", &[]);
    let poses = motion().poses(Split::Test, 0);
    let tokenize = |name: &str| {
        let words = ["tokenize", name, "--tokenizer", &own, "--out", "codes", "--overwrite"];
        place.isoflop(&words)
    };
    type Change = fn([f32; 3]) -> [f32; 3];
    let cases: [(&str, Change, &str); 6] = [
        ("metres", |place| place, ""),
        ("inches", |place| place.map(|c| c / 2.54), "the legs are 0.39"),
        ("hundredths", |place| place.map(|c| c / 100.0), "the legs are 0.010 times"),
        ("child", |place| place.map(|c| 0.6 * c), "the legs are 0.6"),
        ("z_up", |[x, y, z]| [x, -z, y], "the body lies "),
        ("mirrored", |[x, y, z]| [-x, y, z], "the toes are behind the ankles"),
    ];
    for (name, change, words) in cases {
        let changed: Vec<Pose> = poses.iter().map(|pose| pose.map(change)).collect();
        let values = changed.as_flattened().as_flattened();
        let [joints, bvh] = ["npy", "bvh"].map(|ending| format!("{name}.{ending}"));
        write_npy(&place.path(&joints), &[changed.len(), 22, 3], values).expect("a directory");
        place.write(&bvh, fit_bvh(&changed, 20.0).expect("a body").bvh.to_string());
        let features = format!("{name}.features.npy");
        let rows = build_features(&changed);
        write_npy(&place.path(&features), &[rows.len() / N_FEATURES, N_FEATURES], &rows)
            .expect("a directory");
        for file in [joints, bvh, features] {
            // Of features in another unit it is not known whether they are normalised.
            let is_refused = words.starts_with("the legs are 0.39") || words.contains("0.010");
            let is_refused = is_refused && !file.contains("features");
            let ended = tokenize(&file).exits(if is_refused { 2 } else { 0 });
            match words {
                "" => ended.does_not_say("warning"),
                words => ended.says(&file).says(words),
            };
        }
    }
}

#[test]
fn an_original_that_is_no_motion_of_a_body_is_told_by_name() {
    let (place, own) = trained("mini.yaml", &[]);
    let files = write_test_split(&place);
    let tokenize = ["--tokenizer", &own, "--out", "codes"];
    place.isoflop(&words("tokenize", &files[..1], &tokenize)).exits(0);
    let detokenize = |truth: &str| {
        let words = ["detokenize", "codes/0.json", "--truth", truth, "--tokenizer", &own];
        place.isoflop(&[&words[..], &["--out", "made", "--overwrite"]].concat()).exits(0)
    };
    detokenize("truth/0.npy").does_not_say("warning");
    let mirrored = motion().poses(Split::Test, 0).into_iter();
    let mirrored: Vec<Pose> = mirrored.map(|pose| pose.map(|[x, y, z]| [-x, y, z])).collect();
    let rows = build_features(&mirrored);
    let shape = [rows.len() / N_FEATURES, N_FEATURES];
    write_npy(&place.path("mirrored.npy"), &shape, &rows).expect("a writable directory");
    detokenize("mirrored.npy").says("mirrored.npy").says("the toes are behind the ankles");
}

#[test]
fn codes_that_are_no_codes_of_the_tokenizer_are_told() {
    let (place, own) = trained("mini.yaml", &[]);
    let files = write_test_split(&place);
    let place_of = ["--tokenizer", own.as_str()];
    place
        .isoflop(&words("tokenize", &files[..2], &[&place_of[..], &["--out", "codes"]].concat()))
        .exits(0);
    let refused = |change: &dyn Fn(&mut Value), more: &[&str], sentence: &str| {
        let mut clip = place.json("codes/0.json");
        change(&mut clip);
        place.write("changed.json", clip.to_string());
        let more = [&place_of[..], &["--out", "made"], more].concat();
        let ended = place.isoflop(&[&["detokenize", "changed.json"], &more[..]].concat()).exits(2);
        ended.says(sentence);
        assert!(!place.path("made").exists());
    };
    let same = |_: &mut Value| {};
    refused(&|clip| clip["codes"][0] = 64.into(), &[], "64 is no code");
    refused(&|clip| clip["codes"][0] = (-1).into(), &[], "`isoflop tokenize` writes such files");
    refused(&|clip| clip["frames"] = 4.into(), &[], "clips of 4 frames have 1");
    refused(&|clip| clip["codes"] = Value::Array(vec![]), &[], "and it holds 0");
    refused(&|clip| clip["tokenizer_id"] = "b2".into(), &[], "are those of tokenizer b2");
    refused(&|clip| clip["color"] = 1.into(), &[], "unknown field `color`");
    let whole = String::from_utf8(place.read("codes/0.json")).expect("text");
    place.write("codes/0.json", whole.replace("\"frames\": ", "\"frames\": 1"));
    let changed = ["detokenize", "codes/0.json", "--tokenizer", &own, "--out", "made"];
    place.isoflop(&changed).exits(2).says("take its `digest` out");
    place.write("codes/0.json", whole);
    refused(&same, &["--detokenizer-guidance", "2"], "no language that --detokenizer-guidance");
    refused(&same, &["--truth", "absent"], "cannot read absent");
    refused(&same, &["--truth", "codes"], "codes holds no 0.npy");
    refused(&same, &["--truth", "truth/1.txt"], "no motion that can be read");
    write_npy(&place.path("short.npy"), &[8, 263], &[0.5; 8 * 263]).expect("a writable directory");
    refused(&same, &["--truth", "short.npy"], "has 8 frames, and the codes stand for");
    let more = [&place_of[..], &["--out", "made", "--truth", "truth/0.npy"]].concat();
    place
        .isoflop(&words("detokenize", &json_names(&place, "codes"), &more))
        .exits(2)
        .says("is no folder");
    let again = [&["detokenize", "codes/0.json", "--out", "made"], &place_of[..]].concat();
    place.isoflop(&again).exits(0);
    place.isoflop(&again).exits(2).says("is there already; give another --out, or --overwrite");
}
