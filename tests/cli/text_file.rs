//! Captions embedded by another program: the vectors are read from its file.

use std::collections::BTreeSet;
use std::fs;
use std::process::Stdio;

use isoflop::data::{self, Split};
use isoflop::sweep;
use isoflop::text::caption_key;
use safetensors::tensor::{Dtype, TensorView, serialize};
use serde_json::Value;

use super::support::{Ended, Place, records};

/// Width of the vectors of `mini.yaml`.
const DIM: usize = 16;

const FILE: &str = "captions.safetensors";

/// `mini.yaml` with one vocabulary, and its captions' vectors from [`FILE`].
const SETTINGS: [&str; 6] = [
    "--set",
    "text.encoder=file",
    "--set",
    "text.path=captions.safetensors",
    "--set",
    "grid.vocab=[16]",
];

fn with<'a>(first: &[&'a str], settings: &[&'a str]) -> Vec<&'a str> {
    [first, settings].concat()
}

/// Every caption of `mini.yaml`.
fn captions(place: &Place) -> Vec<String> {
    let sweep = sweep::read(&place.path("mini.yaml"), &[]).expect("a sound sweep");
    let source = data::open(&sweep.data, None).expect("the generator needs no file");
    let clips = Split::ALL.into_iter().flat_map(|split| {
        let source = &source;
        (0..source.n_clips(split)).flat_map(move |clip| source.captions(split, clip))
    });
    clips.collect::<BTreeSet<String>>().into_iter().collect()
}

/// A file with one to three vectors a caption, made up of numbers that look random.
fn file(captions: &[String]) -> Vec<u8> {
    let keys: Vec<u64> = captions.iter().map(|caption| caption_key(caption)).collect();
    let mut offsets = vec![0u64];
    for key in &keys {
        offsets.push(offsets[offsets.len() - 1] + 1 + key % 3);
    }
    let n_vectors = *offsets.last().expect("the first is there") as usize;
    let number = |i: usize| (keys[i % keys.len()].rotate_left(i as u32) as i16) as f32 / 2e4;
    let embeddings: Vec<f32> = (0..n_vectors * DIM).map(number).collect();
    let tensors = [
        ("keys", Dtype::U64, vec![keys.len()], bytemuck::cast_slice(&keys)),
        ("offsets", Dtype::U64, vec![offsets.len()], bytemuck::cast_slice(&offsets)),
        ("embeddings", Dtype::F32, vec![n_vectors, DIM], bytemuck::cast_slice(&embeddings)),
    ];
    let views = tensors.map(|(name, dtype, shape, bytes)| {
        (name, TensorView::new(dtype, shape, bytes).expect("shape and length agree"))
    });
    serialize(views, None).expect("sound tensors")
}

/// A place with `mini.yaml` and a file for all captions but the first few.
fn place_without(n_missing: usize) -> (Place, Vec<String>) {
    let place = Place::with("mini.yaml");
    let captions = captions(&place);
    place.write(FILE, file(&captions[n_missing..]));
    (place, captions)
}

#[test]
fn a_sweep_runs_to_its_end_on_the_vectors_of_a_file() {
    let (place, _) = place_without(0);
    let args = with(&["run", "mini.yaml"], &SETTINGS);
    place.isoflop(&args).exits(0);
    let found = records::timeless(&place.path("results/mini"));
    assert_eq!(found.len(), 4);
    assert!(
        found.values().all(|record| record.metrics.get("loss_nats").is_some_and(f64::is_finite))
    );
    fs::rename(place.path(FILE), place.path("moved")).expect("it is there");
    let args = with(&args, &["--set", "text.path=moved"]);
    place.isoflop(&args).exits(0).says("nothing to train");
}

#[test]
fn ids_follow_the_content_of_the_file_and_not_its_place() {
    let (place, captions) = place_without(0);
    let plan = |settings: &[&str]| {
        let args = [&["plan", "mini.yaml", "--json"], &SETTINGS[..], settings].concat();
        place.isoflop(&args).exits(0)
    };
    let id = |settings: &[&str]| plan(settings).json()["runs"][0]["run_id"].clone();
    let here = id(&[]);
    fs::rename(place.path(FILE), place.path("moved")).expect("it is there");
    assert_eq!(id(&["--set", "text.path=moved"]), here);
    let gone = plan(&[]).says("captions.safetensors").says("ids are provisional");
    assert_ne!(gone.json()["runs"][0]["run_id"], here);
    place.write("moved", file(&captions[1..]));
    assert_ne!(id(&["--set", "text.path=moved"]), here);
}

#[test]
fn a_caption_that_the_file_lacks_is_bad_data_and_is_named() {
    let (place, captions) = place_without(1);
    let ended = place.isoflop(&with(&["run", "mini.yaml"], &SETTINGS)).exits(1);
    let ended = ended.says("[bad-data]").says(&format!("for the caption `{}`", captions[0]));
    ended.says("4 of 4 runs have no result");
    let id = &place.names("results/mini/text")[0];
    let failure: Value = place.json(&format!("results/mini/text/{id}/failure.json"));
    assert_eq!(failure["kind"], "bad-data");
    place.write(FILE, file(&captions));
    place.isoflop(&with(&["run", "mini.yaml"], &SETTINGS)).exits(0);
}

#[test]
fn a_file_that_was_exchanged_after_the_plan_is_not_taken_for_the_one_that_was_planned() {
    let (place, captions) = place_without(1);
    place.isoflop(&with(&["run", "mini.yaml"], &SETTINGS)).exits(1);
    let id = &place.names("results/mini/text")[0];
    place.write(FILE, file(&captions));
    let args = ["worker", "results/mini", "text", id];
    let mut worker = place.program(&args);
    worker.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut worker = worker.spawn().expect("the binary can be started");
    // A worker stops when its standard input ends.
    let _input = worker.stdin.take();
    let ended = Ended::of(&args, worker.wait_with_output().expect("it can be waited for"));
    ended.exits(1).says("has changed since the sweep was planned");
}

#[test]
fn a_file_that_cannot_be_used_is_told_before_anything_is_written() {
    let (place, _) = place_without(0);
    let args = with(&["run", "mini.yaml"], &SETTINGS);
    let other = place.isoflop(&with(&args, &["--set", "text.dim=8"])).exits(2);
    other.says("vectors of width 16, and text.dim is 8");
    let bytes = place.read(FILE);
    place.write(FILE, &bytes[..bytes.len() / 2]);
    place.isoflop(&args).exits(2).says("captions.safetensors is damaged").says("make it again");
    fs::remove_file(place.path(FILE)).expect("it is there");
    place.isoflop(&args).exits(2).says("cannot read captions.safetensors");
    assert!(!place.path("results").exists());
}
