//! Tests on small made-up data sets, and on real motion if available.

mod bodies;
mod long;
mod mirrors;

use std::fs;
use std::ops::Range;

use tempfile::TempDir;

use super::*;
use crate::data::npy::npy_bytes;
use crate::data::{FEATURE_GROUPS, parse_npy};
use crate::motion::fixtures::real;
use crate::motion::{mpjpe_mm, recover_joints};

/// Rows that differ in every column and from clip to clip; `[n_frames, 263]`.
fn rows(n_frames: usize, seed: usize) -> Vec<f32> {
    (0..n_frames * N_FEATURES).map(|i| ((i * 31 + seed * 7919) % 1009) as f32 / 1009.0).collect()
}

/// A folder in the HumanML3D layout that lasts as long as the value.
struct DataSet(TempDir);

impl DataSet {
    /// Three sound training clips and one each to validate and test, 60 frames and one caption.
    fn sound() -> DataSet {
        let set = DataSet(tempfile::tempdir().expect("a temporary folder"));
        fs::create_dir(set.path().join("new_joint_vecs")).expect("a writable folder");
        fs::create_dir(set.path().join("texts")).expect("a writable folder");
        for seed in 0..5 {
            set.clip(
                &format!("00000{seed}"),
                60,
                seed,
                "he turns left#he/PRON turn/VERB#0.0#0.0\n",
            );
        }
        set.write("train.txt", "000000\n000001\n000002\n");
        set.write("val.txt", "000003\n");
        set.write("test.txt", "000004\n");
        set
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path().join(name), content).expect("a writable folder");
    }

    fn remove(&self, name: &str) {
        fs::remove_file(self.path().join(name)).expect("the file is there");
    }

    /// Writes the two files of a clip.
    fn clip(&self, id: &str, n_frames: usize, seed: usize, text: &str) {
        self.clip_of(id, &rows(n_frames, seed), text);
    }

    fn clip_of(&self, id: &str, rows: &[f32], text: &str) {
        let bytes = npy_bytes(&[rows.len() / N_FEATURES, N_FEATURES], rows);
        self.write(&format!("new_joint_vecs/{id}.npy"), bytes);
        self.write(&format!("texts/{id}.txt"), text);
    }
}

fn options(mirror: bool, broken: BrokenFiles) -> HumanMl3dOptions {
    HumanMl3dOptions { mirror, broken, ..HumanMl3dOptions::default() }
}

fn skip() -> HumanMl3dOptions {
    options(false, BrokenFiles::Skip)
}

fn open(set: &DataSet, options: &HumanMl3dOptions) -> HumanMl3d {
    HumanMl3d::open(set.path(), options).expect("a usable data set")
}

fn error(set: &DataSet, options: &HumanMl3dOptions) -> DataError {
    HumanMl3d::open(set.path(), options).err().expect("a data set that cannot be used")
}

fn ids(set: &HumanMl3d, split: Split) -> Vec<String> {
    (0..set.n_clips(split)).map(|index| set.clip_id(split, index)).collect()
}

#[test]
fn a_sound_set_gives_its_clips_as_they_are() {
    let set = open(&DataSet::sound(), &options(false, BrokenFiles::Refuse));
    assert_eq!(ids(&set, Split::Train), ["000000", "000001", "000002"]);
    assert_eq!(
        (ids(&set, Split::Val), ids(&set, Split::Test)),
        (vec!["000003".into()], vec!["000004".into()])
    );
    assert_eq!(set.features(Split::Train, 1).expect("in memory"), rows(60, 1));
    assert_eq!(set.captions(Split::Test, 0), ["he turns left"]);
    assert_eq!((set.n_frames(Split::Val, 0), set.fps()), (60, 20.0));
    assert_eq!(set.warnings(), [""; 0]);
}

#[test]
fn statistics_are_computed_from_training_items_if_absent() {
    let data = DataSet::sound();
    let computed = open(&data, &skip());
    let mut accumulator = StatsAccumulator::default();
    (0..3).for_each(|seed| accumulator.add(&rows(60, seed)));
    assert_eq!(Some(computed.stats()), accumulator.finish().as_ref());
    data.write("Mean.npy", npy_bytes(&[263], &[0.25f32; 263]));
    data.write("Std.npy", npy_bytes(&[263], &[2.0f64; 263]));
    let given = open(&data, &skip());
    assert_eq!((given.stats().mean[7], given.stats().std[7]), (0.25, 2.0));
    assert_ne!(given.digest(), computed.digest());
}

#[test]
fn parts_refer_to_their_frames_and_are_mirrored_too() {
    let data = DataSet::sound();
    data.clip("000001", 120, 1, "he walks##0#0\nhe turns left##1.0#4.1\n");
    let set = open(&data, &options(true, BrokenFiles::Skip));
    assert_eq!(ids(&set, Split::Train)[2..6], ["000001", "A_000001", "M000001", "A_M000001"]);
    let part = &rows(120, 1)[20 * N_FEATURES..80 * N_FEATURES];
    assert_eq!(set.features(Split::Train, 3).expect("in memory"), part);
    assert_eq!(set.features(Split::Train, 5).expect("in memory"), mirror_features(part));
    assert_eq!(set.captions(Split::Train, 5), ["he turns right"]);
}

/// A set in which everything that can be broken is, once, beside one sound clip a split.
fn broken_set() -> DataSet {
    let data = DataSet::sound();
    let ids = "000000 shape nan type cut no_text no_caption latin1 bad_line absent";
    let ids: Vec<&str> = ids.split(' ').collect();
    for id in &ids[1..9] {
        data.clip(id, 60, 1, "he stands##0#0\n");
    }
    let features =
        |id: &str, bytes: Vec<u8>| data.write(&format!("new_joint_vecs/{id}.npy"), bytes);
    features("shape", npy_bytes(&[60, 251], &[0.0f32; 60 * 251]));
    features(
        "nan",
        npy_bytes(&[40, 263], &[vec![0.0; 265], vec![f32::NAN; 40 * 263 - 265]].concat()),
    );
    features("type", npy_bytes(&[40, 263], &[0i64; 40 * 263]));
    features("cut", npy_bytes(&[40, 263], &[0.0f32; 40 * 263])[..9000].to_vec());
    data.remove("texts/no_text.txt");
    data.write("texts/no_caption.txt", "\n");
    data.write("texts/latin1.txt", b"caf\xe9##0#0\n");
    data.write("texts/bad_line.txt", "he stands##0#0\nhe sits##5#2\n");
    data.write("train.txt", format!("{}\n000000\n000004\ntwo words\n", ids.join("\n")));
    data
}

/// Where each problem of [`broken_set`] lies, and a word of its reason, in the order of the files.
const PROBLEMS: [(&str, &str); 12] = [
    ("train.txt: line 11", "repeats 000000"),
    ("train.txt: line 12", "lists 000004, which is in test.txt too"),
    ("train.txt: line 13", "`two words`"),
    ("new_joint_vecs/shape.npy", "[60, 251] where [frames, 263]"),
    ("new_joint_vecs/nan.npy", "not finite, the first at [1, 2]"),
    ("new_joint_vecs/type.npy", "'<i8'"),
    ("new_joint_vecs/cut.npy", "bytes"),
    ("texts/no_text.txt", "cannot be read"),
    ("texts/no_caption.txt", "no caption"),
    ("texts/latin1.txt", "UTF-8"),
    ("texts/bad_line.txt: line 2", "from 5 to 2 s"),
    ("new_joint_vecs/absent.npy", "cannot be read"),
];

#[test]
fn broken_files_are_skipped_with_a_warning_each() {
    let set = open(&broken_set(), &skip());
    assert_eq!(ids(&set, Split::Train), ["000000", "bad_line"]);
    assert_eq!(set.captions(Split::Train, 1), ["he stands"]);
    for (warning, (place, reason)) in set.warnings().iter().zip(PROBLEMS) {
        assert!(warning.starts_with(place) && warning.contains(reason), "{warning}");
    }
    // The clip that is absent lacks both its files.
    assert_eq!(set.warnings().len(), PROBLEMS.len() + 1);
}

#[test]
fn refusing_broken_files_lists_them_all() {
    let data = broken_set();
    let message = error(&data, &options(false, BrokenFiles::Refuse)).to_string();
    assert!(message.contains("13 broken files or lines"), "{message}");
    assert_eq!(
        message.lines().skip(1).map(str::trim).collect::<Vec<_>>(),
        open(&data, &skip()).warnings()
    );
}

#[test]
fn clips_of_the_wrong_length_are_left_out_and_not_broken() {
    let data = DataSet::sound();
    data.clip("000000", 39, 0, "short##0#0");
    data.clip("000001", 200, 1, "long##0#0");
    data.clip("000002", 199, 2, "just right##0#0");
    let set = open(&data, &options(false, BrokenFiles::Refuse));
    assert_eq!(
        (ids(&set, Split::Train), set.n_frames(Split::Train, 0)),
        (vec!["000002".into()], 196)
    );
    assert_eq!(set.features(Split::Train, 0).expect("in memory"), rows(199, 2)[..196 * N_FEATURES]);
    assert!(set.warnings()[0].contains("000000 has 39 frames"), "{:?}", set.warnings());
    assert!(set.warnings()[1].contains("000001 has 200 frames"), "{:?}", set.warnings());
}

#[test]
fn a_split_without_usable_clips_is_an_error() {
    let data = DataSet::sound();
    data.write("val.txt", "");
    assert!(matches!(error(&data, &skip()), DataError::EmptySplit { split: "val", .. }));
}

#[test]
fn missing_folders_and_constant_features_say_what_is_needed() {
    let data = DataSet::sound();
    for id in ["000000", "000001", "000002"] {
        data.write(&format!("new_joint_vecs/{id}.npy"), npy_bytes(&[40, 263], &[1.0f32; 40 * 263]));
    }
    assert!(error(&data, &skip()).to_string().contains("add other clips, or Mean.npy"));
    fs::rename(data.path().join("texts"), data.path().join("text")).expect("a writable folder");
    assert!(error(&data, &skip()).to_string().contains("captions in texts"));
}

#[test]
fn the_digest_follows_contents_and_rules_and_not_the_place() {
    let digest =
        |data: &DataSet, options: &HumanMl3dOptions| open(data, options).digest().to_owned();
    let (data, base) = (DataSet::sound(), digest(&DataSet::sound(), &skip()));
    assert_eq!(digest(&data, &skip()), base);
    assert_eq!(digest(&data, &options(false, BrokenFiles::Refuse)), base);
    assert_ne!(digest(&data, &options(true, BrokenFiles::Skip)), base);
    let lengths = LengthRule { min_frames: 44, ..LengthRule::default() };
    assert_ne!(digest(&data, &HumanMl3dOptions { lengths, ..skip() }), base);
    data.write("texts/unlisted.txt", "no clip uses this");
    assert_eq!(digest(&data, &skip()), base);
    data.write("texts/000002.txt", "she turns left##0#0");
    assert_ne!(digest(&data, &skip()), base);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let data = broken_set();
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| open(&data, &options(true, BrokenFiles::Skip)))
    });
    assert_eq!(
        (one.digest(), one.stats(), one.warnings()),
        (four.digest(), four.stats(), four.warnings())
    );
    assert_eq!(ids(&one, Split::Train), ids(&four, Split::Train));
}

#[test]
fn joints_of_another_shape_are_named() {
    let data = DataSet::sound();
    fs::rename(data.path().join("new_joint_vecs"), data.path().join("new_joints"))
        .expect("a writable folder");
    let problem = error(&data, &options(false, BrokenFiles::Refuse)).to_string();
    let expected = "new_joints/000000.npy: has shape [60, 263] where [frames, 22, 3]";
    assert!(problem.contains(expected), "{problem}");
}

#[test]
fn motion_x_has_its_own_folders_and_rate() {
    let root = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, content: &[u8]| {
        let path = root.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
        fs::write(path, content).expect("a writable folder");
    };
    for (seed, id) in ["dance/a_1", "dance/a_2", "kungfu/b", "kungfu/Mb"].iter().enumerate() {
        write(&format!("vector_263/{id}.npy"), &npy_bytes(&[120, 263], &rows(120, seed)));
        write(&format!("texts/semantic_labels/{id}.txt"), b"he turns left\nhe spins##1.0#3.0\n");
    }
    let image = mirror_features(&rows(120, 2));
    write("vector_263/kungfu/Mb.npy", &npy_bytes(&[120, 263], &image));
    write("train.txt", b"dance/a_1\nkungfu/b\n");
    write("val.txt", b"dance/a_2\n");
    write("test.txt", b"dance/a_2/../x\nkungfu/Mb\n");
    let set = HumanMl3d::open(root.path(), &options(true, BrokenFiles::Skip)).expect("a data set");
    assert_eq!(set.fps(), 30.0);
    assert_eq!(ids(&set, Split::Test), ["kungfu/Mb", "A_kungfu/Mb"]);
    assert_eq!(set.n_frames(Split::Test, 1), 60, "two seconds");
    assert_eq!(set.captions(Split::Val, 0), ["he turns left"]);
    let mirrored = ids(&set, Split::Train);
    assert!(mirrored.contains(&"Mdance/a_1".to_string()), "{mirrored:?}");
    assert!(!mirrored.contains(&"Mkungfu/b".to_string()), "its twin is tested on: {mirrored:?}");
    assert!(set.warnings()[0].contains("is `dance/a_2/../x`"), "{:?}", set.warnings());
}

// Real motion; the tests say so where it is not at hand.

#[test]
fn real_motion_opens_whole_and_recovers_finite_bodies() {
    let Some(path) = real("cmu-motion") else { return };
    let set = HumanMl3d::open(&path, &options(true, BrokenFiles::Refuse)).expect("sound data");
    let counts = Split::ALL.map(|split| set.n_clips(split));
    assert_eq!((counts, set.warnings()), ([2 * 463, 33, 61], &[][..]));
    assert_eq!(set.remarks(), [""; 0]);
    for split in Split::ALL {
        for index in 0..set.n_clips(split) {
            let features = set.features(split, index).expect("in memory");
            let poses = recover_joints(&features);
            assert_eq!(poses.len(), set.n_frames(split, index));
            assert!(poses.len().is_multiple_of(4) && (40..=196).contains(&poses.len()));
            assert!(mpjpe_mm(&poses, &poses[..1].repeat(poses.len())).is_finite());
        }
    }
}

#[test]
fn statistics_of_real_motion_agree_with_its_files() {
    let Some(path) = real("cmu-motion") else { return };
    let set = HumanMl3d::open(&path, &skip()).expect("sound data");
    let mut computed = StatsAccumulator::default();
    (0..set.n_clips(Split::Train))
        .for_each(|index| computed.add(&set.features(Split::Train, index).expect("in memory")));
    let computed = computed.finish().expect("real motion varies");
    // The files count the frames that cropping to multiples of 4 takes away, two in a hundred.
    for column in 0..N_FEATURES {
        let deviation = set.stats().std[column];
        assert!((computed.std[column] / deviation - 1.0).abs() < 0.01, "deviation of {column}");
        let shift = (computed.mean[column] - set.stats().mean[column]) / deviation;
        assert!(shift.abs() < 0.01, "mean of {column}: {shift}");
    }
}

#[test]
fn the_digest_of_real_motion_is_the_same_each_time() {
    let Some(path) = real("cmu-motion") else { return };
    let digest = || HumanMl3d::open(&path, &skip()).expect("sound data").digest().to_owned();
    let first = digest();
    assert_eq!((first.len(), &first), (64, &digest()));
}

#[test]
fn features_of_joints_are_those_that_others_made_of_them() {
    let Some(path) = real("bandai-motion") else { return };
    let set = HumanMl3d::open(&path, &options(true, BrokenFiles::Refuse)).expect("sound data");
    assert_eq!(Split::ALL.map(|split| set.n_clips(split)), [2 * 2106, 122, 409]);
    let mut compared = 0;
    for split in Split::ALL {
        for index in 0..set.n_clips(split) {
            let vectors = path.join(format!("check/{}.vec.npy", set.clip_id(split, index)));
            let Ok(bytes) = fs::read(vectors) else { continue };
            let mut expected = parse_npy(&bytes).expect("a sound file").values;
            let found = set.features(split, index).expect("in memory");
            // Clips are cropped to whole units of four frames.
            expected.truncate(found.len());
            // Those were made before joints were rounded to 1/8192 m, which turns short bones.
            for (group, most) in
                FEATURE_GROUPS.into_iter().zip([1e-3, 1e-3, 1e-4, 1e-3, 1e-2, 1e-3])
            {
                let apart = most_apart(&found, &expected, group.clone());
                assert!(apart < most, "{} {group:?}: {apart}", set.clip_id(split, index));
            }
            let poses = [&found, &expected].map(|features| recover_joints(features));
            assert!(mpjpe_mm(&poses[0], &poses[1]) < 1.0);
            compared += 1;
        }
    }
    assert_eq!(compared, 8);
}

fn most_apart(found: &[f32], expected: &[f32], columns: Range<usize>) -> f32 {
    let rows = found.chunks_exact(N_FEATURES).zip(expected.chunks_exact(N_FEATURES));
    let apart = |(a, b): (&[f32], &[f32])| {
        columns.clone().map(|column| (a[column] - b[column]).abs()).fold(0.0, f32::max)
    };
    rows.map(apart).fold(0.0, f32::max)
}

#[test]
fn real_joints_are_those_of_bodies() {
    let Some(path) = real("bandai-motion") else { return };
    let set = HumanMl3d::open(&path, &options(false, BrokenFiles::Refuse)).expect("sound data");
    assert_eq!(set.remarks(), [""; 0]);
}
