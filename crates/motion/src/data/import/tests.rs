mod axes;

use std::fs;
use std::path::{Path, PathBuf};

use super::*;
use crate::data::{HumanMl3d, HumanMl3dOptions, MotionSource, Split, check_folder, parse_npy};
use crate::motion::bvh::{Bvh, fit_bvh};
use crate::motion::fixtures::{procedural, real};
use crate::motion::{N_FEATURES, Pose, features_of_canonical, mpjpe_mm, recover_joints};

pub fn options(from: &Path, form: Form) -> ImportOptions {
    ImportOptions {
        from: from.to_path_buf(),
        form,
        map: Vec::new(),
        up: None,
        left_handed: false,
        fps: None,
        rate: Rate::Fixed(20.0),
        texts: None,
        caption: "a person moves".to_string(),
        group: None,
        overwrite: false,
    }
}

/// The first frames of a motion that has as many.
pub fn motion(seed: u64, n: usize) -> Vec<Pose> {
    let mut long = (seed..).map(|seed| procedural(1000 * seed)).filter(|poses| poses.len() >= n);
    long.next().unwrap()[..n].to_vec()
}

/// Five motions of four names, as BVH with 30 frames per second.
fn folder_of_bvh() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (i, name) in ["walk_01", "walk_02", "run_01", "bow_01", "turn_01"].iter().enumerate() {
        let poses = motion(i as u64, 90 + 20 * i);
        let text = fit_bvh(&poses, 30.0).unwrap().bvh.to_string();
        fs::write(folder.path().join(format!("{name}.bvh")), text).unwrap();
    }
    fs::write(folder.path().join("bow_01.txt"), "he bows#he/PRON bow/VERB#0.0#0.0\nbowing\n")
        .unwrap();
    folder
}

fn open(path: &Path) -> HumanMl3d {
    HumanMl3d::open(path, &HumanMl3dOptions::default()).unwrap()
}

fn files(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        if entry.is_dir() {
            found.extend(files(&entry));
        } else {
            found.push((entry.clone(), fs::read(&entry).unwrap()));
        }
    }
    found.sort();
    found
}

#[test]
fn a_folder_of_bvh_becomes_a_data_set() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let data = to.path().join("mine");
    let imported = import(&options(from.path(), Form::Bvh), &data).unwrap();
    assert_eq!(
        (imported.problems.len(), imported.uncaptioned, imported.captioned_by_name),
        (0, 0, 4)
    );
    assert_eq!(imported.splits.iter().map(|split| split.clips).sum::<usize>(), 5);
    assert!(imported.splits.iter().all(|split| split.clips > 0));
    let set = open(&data);
    let ids: Vec<String> = (Split::ALL.into_iter())
        .flat_map(|split| (0..set.n_clips(split)).map(move |i| (split, i)))
        .map(|(split, i)| set.clip_id(split, i))
        .collect();
    assert_eq!(ids.len(), 5, "{ids:?}");
    assert_eq!(check_folder(&data).problems, [""; 0]);
    let text = fs::read_to_string(data.join("texts/bow_01.txt")).unwrap();
    assert_eq!(text, "he bows#he/PRON bow/VERB#0.0#0.0\nbowing#bowing/OTHER#0.0#0.0\n");
    // Takes of one name are in one split.
    let split = |id: &str| {
        let lists =
            Split::ALL.map(|s| fs::read_to_string(data.join(format!("{}.txt", s.name()))).unwrap());
        lists.iter().position(|list| list.lines().any(|line| line == id)).unwrap()
    };
    assert_eq!(split("walk_01"), split("walk_02"));
}

#[test]
fn the_same_folder_gives_the_same_bytes_and_nothing_is_written_over() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let [a, b] = ["a", "b"].map(|name| to.path().join(name));
    let options = options(from.path(), Form::Bvh);
    import(&options, &a).unwrap();
    import(&options, &b).unwrap();
    let names = |of: &Path| -> Vec<(PathBuf, Vec<u8>)> {
        let bare =
            |(path, bytes): (PathBuf, Vec<u8>)| (path.strip_prefix(of).unwrap().into(), bytes);
        files(of).into_iter().map(bare).collect()
    };
    assert!(names(&a) == names(&b));
    assert!(matches!(import(&options, &a), Err(ImportError::Exists { .. })));
    let again = ImportOptions { overwrite: true, ..options };
    import(&again, &a).unwrap();
    assert!(matches!(import(&again, from.path()), Err(ImportError::NotImported { .. })));
    assert_eq!(fs::read_dir(to.path()).unwrap().count(), 2);
}

#[test]
fn broken_files_are_told_and_the_rest_is_imported() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let good = fs::read_to_string(from.path().join("run_01.bvh")).unwrap();
    let cut = &good[..good.len() / 2];
    let cases = [
        ("cut", cut.to_string(), "numbers"),
        ("nomotion", good.split("MOTION").next().unwrap().to_string(), "the line MOTION"),
        ("nan", good.replacen("\n0.", "\nNaN ", 1), ""),
        ("channels", good.replacen("CHANNELS 6", "CHANNELS 1000000", 1), "a channel such as"),
        ("names", good.replace("left_hip", "first").replace("right_hip", "second"), "left_hip"),
        ("empty", String::new(), "the file ends"),
        ("short", fit_bvh(&motion(1, 12), 30.0).unwrap().bvh.to_string(), ""),
    ];
    for (name, text, _) in &cases {
        fs::write(from.path().join(format!("{name}.bvh")), text).unwrap();
    }
    fs::write(from.path().join("bytes.bvh"), [0xff, 0xfe, 0x00]).unwrap();
    let imported = import(&options(from.path(), Form::Bvh), &to.path().join("a")).unwrap();
    let problem = |name: &str| imported.problems.iter().find(|line| line.starts_with(name));
    for (name, _, words) in cases.iter().filter(|(_, _, words)| !words.is_empty()) {
        let line = problem(&format!("{name}.bvh")).unwrap_or_else(|| panic!("{name} is told"));
        assert!(line.contains(words), "{line}");
    }
    assert!(problem("bytes.bvh").unwrap().contains("UTF-8"));
    assert_eq!(imported.too_short, 1);
    assert!(imported.draft.unwrap().contains("# left_hip: \n"));
}

#[test]
fn a_folder_without_motions_or_groups_is_refused() {
    let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let data = to.path().join("a");
    let problem = |options: &ImportOptions| import(options, &data).unwrap_err().to_string();
    assert!(problem(&options(from.path(), Form::Bvh)).contains("holds no .bvh file"));
    let text = fit_bvh(&motion(1, 100), 30.0).unwrap().bvh.to_string();
    fs::write(from.path().join("walk_01.bvh"), text).unwrap();
    let told = problem(&options(from.path(), Form::Bvh));
    assert!(told.contains("1 group of motions cannot be parted"), "{told}");
    fs::write(from.path().join("walk_01.npy"), b"no").unwrap();
    assert!(problem(&options(from.path(), Form::Joints)).contains("give --fps"));
    let told = problem(&ImportOptions { fps: Some(20.0), ..options(from.path(), Form::Joints) });
    assert!(
        told.contains("no file can be used") && told.contains("walk_01.npy: no npy file"),
        "{told}"
    );
    assert!(!data.exists());
}

/// Places of all joints of a clip of the data set, in metres.
fn places(data: &Path, id: &str) -> Vec<f32> {
    array(&data.join(format!("new_joints/{id}.npy")))
}

#[test]
fn files_of_one_name_are_two_clips_and_links_are_followed_once() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let text = fs::read_to_string(from.path().join("run_01.bvh")).unwrap();
    fs::write(from.path().join("walk 01.bvh"), &text).unwrap();
    std::os::unix::fs::symlink(".", from.path().join("again")).unwrap();
    std::os::unix::fs::symlink("run_01.bvh", from.path().join("a_link.bvh")).unwrap();
    let (data, texts) = (to.path().join("mine"), to.path().join("texts"));
    fs::create_dir(&texts).unwrap();
    for name in ["bow_01", "run_01", "turn_01", "walk_01", "walk_02", "walk 01"] {
        fs::write(texts.join(format!("{name}.txt")), format!("words of {name}\n")).unwrap();
    }
    let own = ImportOptions { texts: Some(texts), ..options(from.path(), Form::Bvh) };
    import(&own, &data).unwrap();
    let captions = |id: &str| fs::read_to_string(data.join(format!("texts/{id}.txt"))).unwrap();
    // `walk 01` sorts first, and has the name that both would have.
    for (id, name) in [("walk_01", "walk 01"), ("walk_01-2", "walk_01"), ("run_01", "run_01")] {
        assert!(captions(id).starts_with(&format!("words of {name}#")), "{id}: {}", captions(id));
    }
    let all = fs::read_to_string(data.join("all.txt")).unwrap();
    let mut ids: Vec<&str> = all.lines().collect();
    ids.sort_unstable();
    assert_eq!(ids, ["bow_01", "run_01", "turn_01", "walk_01", "walk_01-2", "walk_02"]);
}

#[test]
fn files_of_several_folders_and_parts_of_an_earlier_import_are_clips_of_their_own() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let text = fs::read_to_string(from.path().join("run_01.bvh")).unwrap();
    for folder in ["a", "b"] {
        fs::create_dir(from.path().join(folder)).unwrap();
    }
    for name in ["a/x", "b/x", "a_x", "long~1", "long~2"] {
        fs::write(from.path().join(format!("{name}.bvh")), &text).unwrap();
    }
    // Two links that lead to each other's folders have no end.
    for (to, link) in [("../b", "a/to_b"), ("../a", "b/to_a")] {
        std::os::unix::fs::symlink(to, from.path().join(link)).unwrap();
    }
    let data = to.path().join("mine");
    let by = ImportOptions { group: Some(GroupBy::Prefix), ..options(from.path(), Form::Bvh) };
    import(&by, &data).unwrap();
    let all = fs::read_to_string(data.join("all.txt")).unwrap();
    let mut ids: Vec<&str> = all.lines().collect();
    ids.sort_unstable();
    let own = ["bow_01", "long~1", "long~2", "run_01", "turn_01", "walk_01", "walk_02"];
    assert_eq!(ids, [&["a_x", "a_x-2", "b_x"][..], &own].concat());
    let on_disk = fs::read_dir(data.join("new_joint_vecs")).unwrap().count();
    assert_eq!(on_disk, ids.len());
}

#[test]
fn a_rate_or_a_place_that_no_motion_has_is_refused_by_name() {
    let (from, to) = (folder_of_bvh(), tempfile::tempdir().unwrap());
    let text = fs::read_to_string(from.path().join("run_01.bvh")).unwrap();
    let slow = text.replace("Frame Time: 0.03333333", "Frame Time: 1e15");
    assert_ne!(slow, text);
    fs::write(from.path().join("slow.bvh"), slow).unwrap();
    let mut far = Bvh::parse(&text).unwrap();
    far.frames.iter_mut().for_each(|frame| frame[0] += 1e9);
    fs::write(from.path().join("far.bvh"), far.to_string()).unwrap();
    let imported = import(&options(from.path(), Form::Bvh), &to.path().join("mine")).unwrap();
    let [far, slow] = &imported.problems[..] else { panic!("{:?}", imported.problems) };
    assert!(far.starts_with("far.bvh: has a body farther than"), "{far}");
    assert!(slow.starts_with("slow.bvh: has a Frame Time of"), "{slow}");
}

fn array(path: &Path) -> Vec<f32> {
    parse_npy(&fs::read(path).unwrap()).unwrap().values
}

fn poses(values: &[f32]) -> Vec<Pose> {
    let (points, _) = values.as_chunks::<3>();
    let (poses, _) = points.as_chunks::<22>();
    poses.to_vec()
}

fn largest(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn each_stage_agrees_with_real_files() {
    let Some(check) = real("bandai-motion/check") else { return };
    let to = tempfile::tempdir().unwrap();
    let from = tempfile::tempdir().unwrap();
    let mut names = Vec::new();
    for path in fs::read_dir(&check).unwrap().map(|entry| entry.unwrap().path()) {
        let Some(name) = path.to_str().and_then(|path| path.strip_suffix(".bvh")) else { continue };
        fs::copy(&path, from.path().join(path.file_name().unwrap())).unwrap();
        names.push(name.rsplit('/').next().unwrap().to_string());
    }
    import(&options(from.path(), Form::Bvh), &to.path().join("a")).unwrap();
    assert_eq!(names.len(), 8);
    for name in names {
        let bvh =
            Bvh::parse(&fs::read_to_string(check.join(format!("{name}.bvh"))).unwrap()).unwrap();
        let placed: Vec<f32> =
            bvh.positions().iter().flatten().flatten().map(|c| (c / 100.0) as f32).collect();
        let source = array(&check.join(format!("{name}.source.npy")));
        assert!(largest(&placed, &source) < 1e-4, "{name}: forward kinematics");
        let joints = array(&check.join(format!("{name}.joints.npy")));
        let features = features_of_canonical(&poses(&joints));
        let expected = array(&check.join(format!("{name}.vec.npy")));
        assert!(largest(&features, &expected) < 1e-4, "{name}: features");
        let decoded = recover_joints(&features);
        let frames = decoded.len() * 66;
        let off = largest(decoded.as_flattened().as_flattened(), &joints[..frames]);
        assert!(off < 1e-5, "{name}: decoding, {off} m");
        let own = poses(&array(&to.path().join(format!("a/new_joints/{name}.npy"))));
        let theirs = poses(&joints);
        assert_eq!(own.len(), theirs.len(), "{name}");
        let off = mpjpe_mm(&own, &theirs);
        assert!(off < 45.0, "{name}: {off} mm from another retargeting of the same file");
    }
}

#[test]
fn joints_of_a_humanml3d_folder_keep_their_splits_and_features() {
    let Some(bandai) = real("bandai-motion") else { return };
    let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    for folder in ["new_joints", "texts"] {
        fs::create_dir(from.path().join(folder)).unwrap();
    }
    let mut listed = 0;
    for split in Split::ALL {
        let list = fs::read_to_string(bandai.join(format!("{}.txt", split.name()))).unwrap();
        let ids: Vec<&str> = list.lines().step_by(40).collect();
        for id in &ids {
            let copy =
                |name: String| fs::copy(bandai.join(&name), from.path().join(&name)).unwrap();
            copy(format!("new_joints/{id}.npy"));
            copy(format!("texts/{id}.txt"));
        }
        fs::write(from.path().join(format!("{}.txt", split.name())), ids.join("\n")).unwrap();
        listed += ids.len();
    }
    let data = to.path().join("a");
    let imported = import(&options(from.path(), Form::Joints), &data).unwrap();
    assert_eq!(
        (imported.problems.len(), imported.splits.iter().map(|s| s.clips).sum()),
        (0, listed)
    );
    let list = fs::read_to_string(data.join("test.txt")).unwrap();
    for id in list.lines() {
        let joints = array(&bandai.join(format!("new_joints/{id}.npy")));
        let features = array(&data.join(format!("new_joint_vecs/{id}.npy")));
        assert_eq!(features.len() / N_FEATURES, joints.len() / 66 - 1);
        assert!(largest(&features, &features_of_canonical(&poses(&joints))) < 1e-4, "{id}");
        let text =
            |folder: &Path| fs::read_to_string(folder.join(format!("texts/{id}.txt"))).unwrap();
        assert_eq!(text(&data).trim(), text(&bandai).trim());
    }
    assert_eq!(check_folder(&data).problems, [""; 0]);
}

#[test]
fn samples_of_four_skeletons_are_imported() {
    let Some(samples) = real("bvh") else { return };
    let to = tempfile::tempdir().unwrap();
    let options = ImportOptions { group: Some(GroupBy::Prefix), ..options(&samples, Form::Bvh) };
    let imported = import(&options, &to.path().join("a")).unwrap();
    assert_eq!(imported.problems, [""; 0]);
    assert_eq!(imported.skeletons.len(), 4);
    let set = open(&to.path().join("a"));
    for split in Split::ALL {
        for i in 0..set.n_clips(split) {
            let poses = recover_joints(&set.features(split, i).unwrap());
            let mean = |joint: usize| {
                poses.iter().map(|pose| f64::from(pose[joint][1])).sum::<f64>() / poses.len() as f64
            };
            let (pelvis, head, toe) = (mean(0), mean(15), mean(10));
            assert!(
                (0.7..1.1).contains(&pelvis) && head > pelvis + 0.45 && toe < 0.35,
                "{}: {pelvis} {head} {toe}",
                set.clip_id(split, i)
            );
        }
    }
}
