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

/// Twelve clips of the built-in generator, written as HumanML3D has them.
fn data_set() -> Place {
    let place = Place::new();
    place.write("sweep.yaml", SWEEP);
    fs::create_dir_all(place.path("data/new_joint_vecs")).unwrap();
    fs::create_dir_all(place.path("data/texts")).unwrap();
    let counts = [(Split::Train, 8), (Split::Val, 2), (Split::Test, 2)];
    let options = ProceduralOptions { seed: 5, train_clips: 8, val_clips: 2, test_clips: 2 };
    let source = Procedural::new(options);
    for (split, n_clips) in counts {
        let ids: Vec<String> = (0..n_clips).map(|i| format!("{}{i}", split.name())).collect();
        place.write(&format!("data/{}.txt", split.name()), ids.join("\n") + "\n");
        for (i, id) in ids.iter().enumerate() {
            write_clip(&place, id, &source.features(split, i).expect("the generator cannot fail"));
            let lines = source.captions(split, i).into_iter().map(|c| format!("{c}#x/X#0.0#0.0\n"));
            place.write(&format!("data/texts/{id}.txt"), lines.collect::<String>());
        }
    }
    place
}

fn write_clip(place: &Place, id: &str, features: &[f32]) {
    let shape = [(features.len() / N_FEATURES) as u64, N_FEATURES as u64];
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape);
    let mut writer = options.writer(&mut bytes).begin_nd().unwrap();
    writer.extend(features.iter().copied()).unwrap();
    writer.finish().unwrap();
    place.write(&format!("data/new_joint_vecs/{id}.npy"), bytes);
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
    write_clip(&place, "train3", &vec![f32::NAN; 60 * N_FEATURES]);
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
