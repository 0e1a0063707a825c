//! A folder in the HumanML3D layout, sound and broken, from end to end.

use std::fs;

use isoflop::data::{MotionSource, Procedural, ProceduralOptions, Split};
use isoflop::motion::N_FEATURES;
use npyz::WriterBuilder;

use super::support::{Place, records};

const SWEEP: &str = "name: captured
data: {source: humanml3d, path: data, mirror: true}
text: {dim: 16, max_tokens: 12}
tokenizer: {width: 8, depth: 1, steps: 10, batch: 4, window: 40}
grid:
  models: [{n_layer: 1, n_head: 1, d_model: 8}]
  vocab: [16]
  budgets: [2e8]
train: {min_steps: 5, batch: {min: 32}}
";

/// A sweep over `data`, twelve clips of the built-in generator.
fn data_set() -> Place {
    let place = Place::new();
    place.write("sweep.yaml", SWEEP);
    write_set(&place, "data", 5, TWELVE);
    place
}

/// Clips to train, to validate and to test on.
const TWELVE: [usize; 3] = [8, 2, 2];

/// Clips of the built-in generator, written as HumanML3D has them.
pub fn write_set(place: &Place, folder: &str, seed: u64, n_clips: [usize; 3]) {
    fs::create_dir_all(place.path(folder).join("new_joint_vecs")).unwrap();
    fs::create_dir_all(place.path(folder).join("texts")).unwrap();
    let [train_clips, val_clips, test_clips] = n_clips;
    let options = ProceduralOptions { seed, train_clips, val_clips, test_clips };
    let source = Procedural::new(options);
    for (split, n_clips) in Split::ALL.into_iter().zip(n_clips) {
        let ids: Vec<String> = (0..n_clips).map(|i| format!("{}{i}", split.name())).collect();
        place.write(&format!("{folder}/{}.txt", split.name()), ids.join("\n") + "\n");
        for (i, id) in ids.iter().enumerate() {
            let features = source.features(split, i).expect("the generator cannot fail");
            write_clip(place, folder, id, &features);
            let tagged = |word: &str| format!("{word}/X ");
            let line = |c: String| {
                let tokens: String = c.split_whitespace().map(tagged).collect();
                format!("{c}#{}#0.0#0.0\n", tokens.trim())
            };
            let lines: String = source.captions(split, i).into_iter().map(line).collect();
            place.write(&format!("{folder}/texts/{id}.txt"), lines);
        }
    }
}

fn write_clip(place: &Place, folder: &str, id: &str, features: &[f32]) {
    let shape = [(features.len() / N_FEATURES) as u64, N_FEATURES as u64];
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape);
    let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
    writer.extend(features.iter().copied()).unwrap();
    writer.finish().unwrap();
    place.write(&format!("{folder}/new_joint_vecs/{id}.npy"), bytes);
}

#[test]
fn a_sound_folder_is_trained_on_from_end_to_end() {
    let place = data_set();
    let ended = place.isoflop(&["run", "sweep.yaml"]).exits(0);
    ended.does_not_say("broken").does_not_say("skipped");
    let found = records::timeless(&place.path("results/captured"));
    assert_eq!(found.len(), 1);
    assert!(found.values().all(|record| record.loss("loss_nats").unwrap().is_finite()));
    place.isoflop(&["run", "sweep.yaml"]).exits(0).says("nothing to train");
    let plan = place.isoflop(&["plan", "sweep.yaml", "--json"]).exits(0).json();
    assert_eq!(plan["runs"][0]["state"], "done");
}

#[test]
fn the_same_data_elsewhere_has_the_same_ids_and_other_data_others() {
    let place = data_set();
    let id = |place: &Place, path: &str| {
        let setting = format!("data.path={path}");
        let args = ["plan", "sweep.yaml", "--json", "--set", &setting];
        place.isoflop(&args).exits(0).json()["runs"][0]["run_id"].clone()
    };
    let here = id(&place, "data");
    fs::rename(place.path("data"), place.path("moved")).unwrap();
    assert_eq!(id(&place, "moved"), here);
    place.write("moved/texts/train0.txt", "a person stands#x/X#0.0#0.0\n");
    assert_ne!(id(&place, "moved"), here);
}

#[test]
fn broken_files_are_skipped_by_name_or_refused_all_at_once() {
    let place = data_set();
    let whole = place.read("data/new_joint_vecs/train1.npy");
    place.write("data/new_joint_vecs/train1.npy", &whole[..whole.len() / 2]);
    fs::remove_file(place.path("data/texts/train2.txt")).unwrap();
    write_clip(&place, "data", "train3", &vec![f32::NAN; 60 * N_FEATURES]);
    let broken = ["train1", "train2", "train3"];

    let refused = place.isoflop(&["run", "sweep.yaml", "--set", "data.broken=refuse"]).exits(2);
    let refused = refused.says("3 broken files");
    assert!(broken.iter().all(|name| refused.stderr().contains(name)), "{}", refused.stderr());
    assert!(!place.path("results").exists(), "nothing is written");

    let skipped = place.isoflop(&["run", "sweep.yaml", "--set", "data.broken=skip"]).exits(0);
    for name in broken {
        let stderr = skipped.stderr();
        let mut lines = stderr.lines();
        assert!(lines.any(|l| l.starts_with("warning: ") && l.contains(name)), "{name}: {stderr}");
    }
    assert_eq!(records::bytes(&place.path("results/captured")).len(), 1);
}

#[test]
fn long_clips_train_the_tokenizer_that_reads_their_caption_and_nothing_else() {
    let place = data_set();
    let clips: Vec<Vec<f32>> = (0..5).map(|i| features(&place, &format!("train{i}"))).collect();
    write_clip(&place, "data", "long", &clips.concat());
    place.write("data/texts/long.txt", "a zigzag without end#a/X#0.0#0.0\n");
    let listed = String::from_utf8(place.read("data/train.txt")).unwrap();
    place.write("data/train.txt", listed + "long\n");
    let tokenizer = "tokenizer={kind: transformer, width: 8, heads: 2, latent: 4, steps: 5, batch: 4, \
                     language: {at: [tokenizer, detokenizer], drop: 0.1}}";
    let run = |long_clips: &str| {
        let name = format!("name={long_clips}");
        let long = format!("data.long_clips={long_clips}");
        let set = ["data.mirror=false", tokenizer, &name, &long].map(|key| ["--set", key]);
        let ended = place.isoflop(&[&["run", "sweep.yaml"], &set.concat()[..]].concat()).exits(0);
        let results = format!("results/{long_clips}");
        let record = records::timeless(&place.path(&results)).into_values().next().unwrap();
        let own = place.names(&format!("{results}/tokenizers")).remove(0);
        let metrics = place.read(&format!("{results}/tokenizers/{own}/metrics.json"));
        let metrics: serde_json::Value = serde_json::from_slice(&metrics).unwrap();
        (ended, record.measured.unique_tokens, metrics["mpjpe_mm"].as_f64().unwrap())
    };
    let [(skipped, tokens, error), (halved, same, other)] = ["skip", "half"].map(run);
    skipped.says("long has");
    halved.does_not_say("long has");
    assert_eq!(tokens, same, "no generator trains on it");
    assert_ne!(error, other);
    let procedural = "data={source: procedural, long_clips: mix}";
    place.isoflop(&["plan", "sweep.yaml", "--set", procedural]).exits(2).says("data.long_clips");
}

/// The features of a training clip of [`write_set`].
fn features(place: &Place, id: &str) -> Vec<f32> {
    let bytes = place.read(&format!("data/new_joint_vecs/{id}.npy"));
    npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap()
}

#[test]
fn a_union_is_trained_on_whole_and_says_what_it_is_of() {
    let place = data_set();
    fs::rename(place.path("data"), place.path("one")).unwrap();
    write_set(&place, "two", 6, TWELVE);
    let members = "[{path: one, licence: CC0}, {path: two, name: other}]";
    let union = ["--set".to_owned(), format!("data={{mirror: false, union: {members}}}")];
    let union = union.each_ref().map(String::as_str);
    let plan = place.isoflop(&[&["plan", "sweep.yaml"][..], &union].concat()).exits(0);
    let told = plan.stdout();
    for words in ["data: 16 clips to train on", "8, 2 and 2 clips; CC0", "other: ", "not given"] {
        assert!(told.contains(words), "{words}: {told}");
    }
    let document = place.isoflop(&[&["plan", "sweep.yaml", "--json"][..], &union].concat());
    let document = document.exits(0).json();
    assert_eq!(document["data_sets"][1]["name"], "other");
    assert_eq!(document["data_sets"][0]["clips"], serde_json::json!([8, 2, 2]));
    place.isoflop(&[&["run", "sweep.yaml"][..], &union].concat()).exits(0);
    assert_eq!(records::bytes(&place.path("results/captured")).len(), 1);
}

#[test]
fn a_union_has_no_folder_of_its_own_and_names_the_one_that_is_missing() {
    let place = data_set();
    let with = |setting: &str| {
        place.isoflop(&["plan", "sweep.yaml", "--set", &format!("data={{{setting}}}")])
    };
    with("path: data, union: [{path: data}]").exits(2).says("a union is all the data there is");
    with("union: [{path: data}, {path: nowhere}]").exits(0).says("nowhere/new_joint_vecs");
    with("union: [{folder: data}]").exits(2).says("unknown name `folder`");
}
