//! Tests on small data sets written for the purpose, and on real motion where it is at hand.

mod real;

use super::*;
use crate::data::fixtures::{DataSet, npy_bytes, rows};

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
fn each_training_clip_is_joined_by_its_mirror_image() {
    let set = open(&DataSet::sound(), &options(true, BrokenFiles::Skip));
    assert_eq!(
        ids(&set, Split::Train),
        ["000000", "M000000", "000001", "M000001", "000002", "M000002"]
    );
    assert_eq!((set.n_clips(Split::Val), set.n_clips(Split::Test)), (1, 1));
    assert_eq!(set.features(Split::Train, 3).expect("in memory"), mirror_features(&rows(60, 1)));
    assert_eq!(set.captions(Split::Train, 3), ["he turns right"]);
}

#[test]
fn mirrored_files_of_the_set_are_taken_as_they_are() {
    let data = DataSet::sound();
    data.clip("M000000", 48, 9, "as it is##0#0");
    data.clip("M000001", 52, 10, "as it is, listed##0#0");
    data.write("train.txt", "000000\nM000001\n000001\n000002\n");
    let set = open(&data, &options(true, BrokenFiles::Skip));
    assert_eq!(
        ids(&set, Split::Train),
        ["000000", "M000000", "M000001", "000001", "000002", "M000002"]
    );
    assert_eq!(set.features(Split::Train, 1).expect("in memory"), rows(48, 9));
    assert_eq!(set.captions(Split::Train, 2), ["as it is, listed"]);
    assert_eq!(ids(&open(&data, &skip()), Split::Train), ["000000", "M000001", "000001", "000002"]);
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
    let ids = [
        "000000",
        "shape",
        "nan",
        "type",
        "cut",
        "no_text",
        "no_caption",
        "latin1",
        "bad_line",
        "absent",
    ];
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
    std::fs::rename(data.path().join("texts"), data.path().join("text"))
        .expect("a writable folder");
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
    std::fs::rename(data.path().join("new_joint_vecs"), data.path().join("new_joints"))
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
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a writable folder");
        std::fs::write(path, content).expect("a writable folder");
    };
    for (seed, id) in ["dance/a_1", "dance/a_2", "kungfu/b", "kungfu/Mb"].iter().enumerate() {
        write(&format!("vector_263/{id}.npy"), &npy_bytes(&[120, 263], &rows(120, seed)));
        write(&format!("texts/semantic_labels/{id}.txt"), b"he turns left\nhe spins##1.0#3.0\n");
    }
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
