//! `isoflop run --track`: trackers that follow the training.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::support::{Place, records};

/// Two steps told, a validation curve of two lines, and where the trainer is told to track its run.
const TRAINER: &str = r#"
env | grep ISOFLOP_TRACK | sort > told.txt
echo '{"step": 1, "steps": 2, "loss": 3.5, "tokens_per_s": 1000}'
sleep 0.3
echo '{"step": 2, "steps": 2, "loss": 3.25}'
line='"tokens": 9, "lr": 0.1, "train_loss_nats": 3.4, "val_loss_normalised"'
log="{\"step\": 1, $line: -0.5}, {\"step\": 2, $line: -0.75}"
echo "{\"loss_nats\": 4.0, \"unigram_nats\": 5.0, \"log\": [$log]}" > "$2"
"#;

/// What an event of a file says: a tag with its step and value, or that the training began at a step.
type Said = (String, u64, f32);

/// CRC-32C, bit by bit, masked as TFRecords have it.
fn crc(data: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in data {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0x82f6_3b78 } else { crc >> 1 };
        }
    }
    let crc = !crc;
    crc.rotate_right(15).wrapping_add(0xa282_ead8)
}

/// The records of a file, each with its checksums held.
fn read(path: &Path) -> Vec<Said> {
    let bytes = fs::read(path).expect("a readable file");
    let (mut rest, mut said) = (&bytes[..], Vec::new());
    while !rest.is_empty() {
        let (length, after) = rest.split_at(8);
        let (sum, after) = after.split_at(4);
        assert_eq!(sum, crc(length).to_le_bytes());
        let (data, after) = after.split_at(u64::from_le_bytes(length.try_into().unwrap()) as usize);
        let (sum, after) = after.split_at(4);
        assert_eq!(sum, crc(data).to_le_bytes());
        said.extend(event(data));
        rest = after;
    }
    said
}

/// An event: its time, its step, and a summary of one value or the beginning of a session.
fn event(data: &[u8]) -> Option<Said> {
    assert_eq!(data[0], 0x09);
    let rest = &data[9..];
    if rest[0] == 0x1a {
        assert_eq!(&rest[2..], b"brain.Event:2");
        return None;
    }
    assert_eq!(rest[0], 0x10);
    let bytes = 1 + rest[1..].iter().take_while(|byte| **byte >= 0x80).count();
    let step = (0..bytes).map(|at| u64::from(rest[1 + at] & 0x7f) << (7 * at)).sum();
    let rest = &rest[1 + bytes..];
    if rest[0] == 0x3a {
        return Some(("start".to_string(), step, 0.0));
    }
    assert_eq!((rest[0], rest[2], rest[4]), (0x2a, 0x0a, 0x0a));
    let (tag, value) = rest[6..].split_at(rest[5] as usize);
    assert_eq!(value[0], 0x15);
    let value = f32::from_le_bytes(value[1..].try_into().unwrap());
    Some((String::from_utf8(tag.to_vec()).unwrap(), step, value))
}

/// The files of each run's folder, the oldest first.
fn files(place: &Place, sweep: &str) -> BTreeMap<String, Vec<Vec<Said>>> {
    let root = format!("results/{sweep}/tensorboard");
    let runs = place.names(&root).into_iter().map(|run| {
        let folder = format!("{root}/{run}");
        let files = place.names(&folder);
        assert!(files.iter().all(|name| name.starts_with("events.out.tfevents.")), "{files:?}");
        (run, files.iter().map(|name| read(&place.path(&format!("{folder}/{name}")))).collect())
    });
    runs.collect()
}

#[test]
fn event_files_follow_every_run_of_a_sweep() {
    let place = Place::with("mini.yaml");
    place.isoflop(&["run", "mini.yaml", "--jobs", "3", "--track", "tensorboard"]).exits(0);
    let runs = files(&place, "mini");
    assert_eq!(runs.len(), records::bytes(&place.path("results/mini")).len());
    for (run, files) in runs {
        let [said] = &files[..] else { panic!("{run}: {} files", files.len()) };
        assert!(said.iter().all(|(.., value)| value.is_finite()), "{run}: {said:?}");
        for tag in ["train/loss_nats", "val/loss_normalised", "test/loss_normalised"] {
            let steps: Vec<u64> = said.iter().filter(|one| one.0 == tag).map(|one| one.1).collect();
            assert!(!steps.is_empty() && steps.is_sorted(), "{run}: {tag}: {steps:?}");
        }
    }
    assert!(place.json("results/mini/command.json").to_string().contains("tensorboard"));
}

#[test]
fn a_run_that_begins_again_goes_on_in_a_new_file() {
    let place = Place::trained_by(TRAINER);
    let run = ["run", "own.yaml", "--track", "tensorboard"];
    place.isoflop(&run).exits(0);
    let id = &place.names("results/own/runs")[0];
    fs::remove_file(place.path(&format!("results/own/runs/{id}/record.json"))).unwrap();
    place.isoflop(&run).exits(0);
    let runs = files(&place, "own");
    let (name, files) = runs.first_key_value().expect("one run");
    assert_eq!(*name, format!("L1-d8-V64-C=1e9-seed-0-{}", &id[..6]));
    let said = |tag: &str, step, value| (tag.to_string(), step, value);
    let expected = [
        said("start", 1, 0.0),
        said("train/loss_nats", 1, 3.5),
        said("train/tokens_per_s", 1, 1000.0),
        said("train/loss_nats", 2, 3.25),
        said("val/loss_normalised", 1, -0.5),
        said("val/loss_normalised", 2, -0.75),
        said("test/loss_normalised", 2, -1.0),
    ];
    assert_eq!(*files, [&expected, &expected]);
}

#[test]
fn files_that_cannot_be_written_are_one_warning() {
    let place = Place::trained_by(TRAINER);
    fs::create_dir_all(place.path("results/own")).unwrap();
    place.write("results/own/tensorboard", "a file");
    let ended = place.isoflop(&["run", "own.yaml", "--track", "tensorboard"]).exits(0);
    let stderr = ended.stderr();
    assert_eq!(stderr.matches("not all of the curves could be written").count(), 1, "{stderr}");
}

#[test]
fn trackers_of_python_reach_the_trainer_and_want_one() {
    let place = Place::trained_by(TRAINER);
    place.isoflop(&["run", "own.yaml", "--track", "wandb"]).exits(0);
    let told = String::from_utf8(place.read("told.txt")).unwrap();
    assert_eq!(told, "ISOFLOP_TRACK=wandb\nISOFLOP_TRACK_PROJECT=own\n");
    assert!(!place.path("results/own/tensorboard").exists());
    for tracker in ["wandb", "mlflow"] {
        let place = Place::with("mini.yaml");
        let refused = place.isoflop(&["run", "mini.yaml", "--track", tracker]).exits(2);
        refused.says("`trainer: torch`").says("--track tensorboard");
        assert!(!place.path("results").exists());
    }
}
