//! Motions: BVH, arrays, folders of them with their captions.

use std::fs;
use std::path::{Path, PathBuf};

use isoflop::data::import::{Form, GroupBy, ImportOptions, Rate, import, read_map};
use isoflop::data::{
    HumanMl3d, HumanMl3dOptions, MotionSource, Procedural, ProceduralOptions, Split,
    parse_annotation, parse_npy, read_motion, write_npy,
};
use isoflop::motion::bvh::{Bvh, fit_bvh};
use isoflop::motion::{N_FEATURES, Pose, build_features};

use super::{bundle, part, words};
use crate::harness::Kind;
use crate::mutate;

pub const BVH: Kind =
    Kind { name: "bvh", file: "a.bvh", seeds: bvh_seeds, mutate: mutate::text, read: bvh };
pub const NPY: Kind =
    Kind { name: "npy", file: "a.npy", seeds: arrays, mutate: mutate::binary, read: npy };
pub const IMPORT: Kind = Kind {
    name: "import",
    file: "from/c/c.bvh",
    seeds: import_seeds,
    mutate: mutate::text,
    read: imported,
};
pub const MAP: Kind =
    Kind { name: "map", file: "map.yaml", seeds: maps, mutate: mutate::text, read: map };
pub const FOLDER: Kind =
    Kind { name: "folder", file: "files", seeds: folder_seeds, mutate: mutate::text, read: folder };

/// Poses of a made-up clip, the first of them.
fn poses(clip: usize, n: usize) -> Vec<Pose> {
    let options = ProceduralOptions { seed: 1, train_clips: 4, val_clips: 1, test_clips: 1 };
    let mut poses = Procedural::new(options).poses(Split::Train, clip);
    poses.truncate(n);
    poses
}

fn bvh_of(clip: usize, n: usize) -> String {
    fit_bvh(&poses(clip, n), 20.0).expect("a sound motion").bvh.to_string()
}

/// Two roots, channels in any order, joints without any, a name of two words.
const ANY_BVH: &str = "HIERARCHY\nROOT Hips\n{\n  OFFSET 1 2 3\n  CHANNELS 6 Xposition Yposition Zposition \
    Zrotation Xrotation Yrotation\n  JOINT Left Leg\n  {\n    CHANNELS 1 xrotation\n    OFFSET 0 -10 0\n    End \
    Site\n    {\n      OFFSET 0 -5 0\n    }\n  }\n}\nROOT b\n{\n  OFFSET 1 0 0\n  CHANNELS 1 Yposition\n}\n\
    MOTION\nFrames: 2\nFrame Time: 0.05\n0 0 0 0 0 0 0 0\n1 20 3 0 0 90 90 7\n";

fn bvh_seeds(_: &Path) -> Vec<Vec<u8>> {
    [bvh_of(0, 4), bvh_of(1, 2), ANY_BVH.to_string()].map(String::into_bytes).to_vec()
}

/// Joints of the largest body that is written.
const MOST_JOINTS: usize = 1000;

/// As a hierarchy of any kind, and as a motion of the skeleton of 22.
fn bvh(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    if let Ok(features) =
        read_motion(path, 20.0).map_err(words).inspect_err(|told| assert!(!told.is_empty()))
    {
        assert!(
            features.iter().all(|x| x.is_finite()) && features.len().is_multiple_of(N_FEATURES)
        );
    }
    let bvh = Bvh::parse(std::str::from_utf8(&bytes).map_err(words)?).map_err(words)?;
    assert!(bvh.frames.iter().flatten().all(|x| x.is_finite()), "its numbers are finite");
    assert_eq!(bvh.positions().len(), bvh.frames.len());
    if bvh.joints.len() > MOST_JOINTS {
        // No body of ours: it is not written.
        return Ok(());
    }
    let text = bvh.to_string();
    let again =
        Bvh::parse(&text).unwrap_or_else(|error| panic!("what is written is not read: {error}"));
    assert_eq!(again.to_string(), text, "what is written is read as another");
    Ok(())
}

fn arrays(place: &Path) -> Vec<Vec<u8>> {
    let path = place.join("seed.npy");
    let write = |shape: &[usize], values: &[f32]| {
        write_npy(&path, shape, values).expect("a writable folder");
        fs::read(&path).expect("just written")
    };
    let poses = poses(0, 4);
    let features = build_features(&poses);
    vec![
        write(&[4, 22, 3], poses.as_flattened().as_flattened()),
        write(&[3, N_FEATURES], &features),
    ]
}

fn npy(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    if let Ok(array) = parse_npy(&bytes) {
        assert_eq!(array.shape.iter().product::<usize>(), array.values.len());
        assert!(array.values.iter().all(|x| x.is_finite()));
    }
    let features = read_motion(path, 20.0).map_err(words)?;
    assert!(features.iter().all(|x| x.is_finite()) && features.len().is_multiple_of(N_FEATURES));
    Ok(())
}

/// Two motions that stay, beside the one that changes.
fn import_seeds(place: &Path) -> Vec<Vec<u8>> {
    for (folder, clip) in [("a", 0), ("b", 1), ("c", 2)] {
        let folder = place.join("from").join(folder);
        fs::create_dir_all(&folder).expect("a writable folder");
        if clip < 2 {
            fs::write(folder.join("motion.bvh"), bvh_of(clip, 42)).expect("a writable folder");
        }
    }
    vec![bvh_of(2, 42).into_bytes(), bvh_of(3, 44).into_bytes()]
}

fn imported(path: &Path) -> Result<(), String> {
    let folder = path.ancestors().nth(3).expect("the folder of the kind");
    let options = ImportOptions {
        from: folder.join("from"),
        form: Form::Bvh,
        map: Vec::new(),
        up: None,
        left_handed: false,
        fps: None,
        rate: Rate::Fixed(20.0),
        texts: None,
        caption: "a person moves".to_string(),
        group: Some(GroupBy::Folder),
        overwrite: true,
    };
    let to: PathBuf = folder.join("to");
    let found = import(&options, &to).map_err(words)?;
    assert!(
        found.problems.iter().all(|problem| problem.chars().count() < 2000),
        "{:?}",
        found.problems
    );
    Ok(())
}

fn maps(_: &Path) -> Vec<Vec<u8>> {
    vec![b"pelvis: Hips\nleft_hip: LeftUpLeg\n\"head\": 'Head 1'\n".to_vec()]
}

fn map(path: &Path) -> Result<(), String> {
    read_map(path).map(drop).map_err(words)
}

/// The files beside the motions of a folder in HumanML3D's layout.
const FILES: [&str; 7] = [
    "train.txt",
    "val.txt",
    "test.txt",
    "manifest.csv",
    "import.json",
    "texts/a.txt",
    "texts/b.txt",
];

fn folder_seeds(place: &Path) -> Vec<Vec<u8>> {
    let root = place.join("data");
    fs::create_dir_all(root.join("texts")).expect("a writable folder");
    for (clip, name) in ["a", "b", "c"].into_iter().enumerate() {
        let rows = build_features(&poses(clip, 61));
        let path = root.join(format!("new_joint_vecs/{name}.npy"));
        write_npy(&path, &[rows.len() / N_FEATURES, N_FEATURES], &rows).expect("a writable folder");
        fs::write(root.join(format!("texts/{name}.txt")), "a person walks\n")
            .expect("a writable folder");
    }
    let caption = "A man waves, slowly.#a/DET man/NOUN wave/VERB slowly/ADV#0.0#0.0\nhe sits#he/PRON#0.5#2.75\n";
    let manifest = "id,group\na,x\nb,\"y, z\"\n";
    let one = [
        ("train.txt", "a\n"),
        ("val.txt", "b\n"),
        ("test.txt", "c\n"),
        ("manifest.csv", manifest),
        ("import.json", "{\"fps\": 20.0, \"form\": \"bvh\"}"),
        ("texts/a.txt", caption),
        ("texts/b.txt", "he sits\n"),
    ];
    vec![bundle(&one)]
}

fn folder(path: &Path) -> Result<(), String> {
    let bytes = fs::read(path).expect("just written");
    let root = path.with_file_name("data");
    for name in FILES {
        fs::write(root.join(name), part(&bytes, name)).expect("a writable folder");
    }
    let text = String::from_utf8_lossy(&part(&bytes, "texts/a.txt")).into_owned();
    let mut annotations = text.lines().filter_map(|line| parse_annotation(line).ok());
    assert!(annotations.all(|one| !one.caption.is_empty()));
    let options = HumanMl3dOptions { mirror: true, ..HumanMl3dOptions::default() };
    let data = HumanMl3d::open(&root, &options).map_err(words)?;
    for split in Split::ALL {
        for clip in 0..data.n_clips(split) {
            let features = data.features(split, clip).map_err(words)?;
            assert_eq!(features.len(), data.n_frames(split, clip) * N_FEATURES);
            assert!(!data.captions(split, clip).is_empty() && !data.group(split, clip).is_empty());
        }
    }
    assert!(data.metadata().fps > 0.0, "{}", data.metadata().fps);
    Ok(())
}
