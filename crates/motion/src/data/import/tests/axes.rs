//! Files whose axes, sides or OFFSETs are not those of the others.

use super::*;
use crate::motion::bvh::{Axis, BvhJoint, Channel};

/// The same motion from a file whose OFFSETs are turned by a quarter about y, and its channels with them: what
/// turned about x turns about -z, and what turned about z about x.
fn quarter_turned(bvh: &Bvh) -> Bvh {
    let mut turned = bvh.clone();
    let turn = |[x, y, z]: [f64; 3]| [z, y, -x];
    let mut column = 0;
    for joint in &mut turned.joints {
        joint.offset = turn(joint.offset);
        joint.end_sites.iter_mut().for_each(|end| *end = turn(*end));
        for channel in &mut joint.channels {
            let (other, sign, less) = match *channel {
                Channel::Rotation(Axis::Y) if joint.parent.is_none() => (*channel, 1.0, 90.0),
                Channel::Rotation(Axis::X) => (Channel::Rotation(Axis::Z), -1.0, 0.0),
                Channel::Rotation(Axis::Z) => (Channel::Rotation(Axis::X), 1.0, 0.0),
                same => (same, 1.0, 0.0),
            };
            *channel = other;
            turned.frames.iter_mut().for_each(|frame| frame[column] = sign * frame[column] - less);
            column += 1;
        }
    }
    turned
}

/// Whether the clips of [`folder_of_bvh`] are the same in two data sets, to a tenth of a millimetre.
fn assert_all_alike(a: &Path, b: &Path) {
    for id in ["bow_01", "run_01", "turn_01", "walk_01", "walk_02"] {
        let off = largest(&places(a, id), &places(b, id));
        assert!(off < 1e-4, "{id}: {off} m");
    }
}

/// Writes the files of a folder again, each under a further root that turns it about x by so many degrees.
fn under_a_root(from: &Path, degrees: impl Fn(&str) -> f64) {
    for (path, bytes) in
        files(from).into_iter().filter(|(path, _)| path.extension().unwrap() == "bvh")
    {
        let mut bvh = Bvh::parse(std::str::from_utf8(&bytes).unwrap()).unwrap();
        let turn = degrees(path.file_stem().unwrap().to_str().unwrap());
        bvh.joints
            .iter_mut()
            .for_each(|joint| joint.parent = Some(joint.parent.map_or(0, |p| p + 1)));
        let (name, channels) = ("armature".to_string(), vec![Channel::Rotation(Axis::X)]);
        let root =
            BvhJoint { name, parent: None, offset: [0.0; 3], channels, end_sites: Vec::new() };
        bvh.joints.insert(0, root);
        bvh.frames.iter_mut().for_each(|frame| frame.insert(0, turn));
        fs::write(path, bvh.to_string()).unwrap();
    }
}

#[test]
fn a_file_with_another_axis_up_stands_among_the_others() {
    let to = tempfile::tempdir().unwrap();
    let [plain, mixed, halves, lying] = ["a", "b", "c", "d"].map(|name| to.path().join(name));
    let import_with = |degrees: fn(&str) -> f64, data: &Path, up: Option<&str>| {
        let from = folder_of_bvh();
        under_a_root(from.path(), degrees);
        let up = up.map(|up| up.parse().unwrap());
        import(&ImportOptions { up, ..options(from.path(), Form::Bvh) }, data).unwrap()
    };
    assert_eq!(import_with(|_| 0.0, &plain, None).remarks, [""; 0]);
    let one = import_with(|name| if name == "walk_02" { 90.0 } else { 0.0 }, &mixed, None);
    let [remark] = &one.remarks[..] else { panic!("{:?}", one.remarks) };
    assert!(remark.starts_with("walk_02.bvh: stands along z, where the others"), "{remark}");
    assert!(one.problems.is_empty() && one.skeletons.len() == 1 && one.skeletons[0].up == "y");
    assert_all_alike(&plain, &mixed);
    // The sum over all files lies along no axis.
    let many = import_with(|name| if name < "run_02" { -90.0 } else { 0.0 }, &halves, None);
    assert_eq!(many.problems, [""; 0]);
    assert_all_alike(&plain, &halves);
    // An axis that is told is taken, and a body that lies then is told.
    let told = import_with(|name| if name == "walk_02" { 90.0 } else { 0.0 }, &lying, Some("y"));
    assert!(told.remarks.iter().any(|line| line.contains("walk_02")), "{:?}", told.remarks);
}

/// The same motion from a file in which each joint has its place in its parent's frame and nothing turns, its x
/// reversed or not, OFFSETs and names as they were.
fn by_places(bvh: &Bvh, sign: f64) -> Bvh {
    let mut placed = bvh.clone();
    let axes = Axis::ALL.map(Channel::Position).to_vec();
    placed.joints.iter_mut().for_each(|joint| joint.channels = axes.clone());
    let places = |frame: Vec<[f64; 3]>| {
        let before = |parent: Option<usize>| parent.map_or([0.0; 3], |parent| frame[parent]);
        let joints = bvh.joints.iter().zip(&frame);
        let steps = joints.map(|(joint, at)| {
            let from = before(joint.parent);
            [sign * (at[0] - from[0]), at[1] - from[1], at[2] - from[2]]
        });
        steps.flatten().collect()
    };
    placed.frames = bvh.positions().into_iter().map(places).collect();
    placed
}

#[test]
fn one_mirrored_file_among_others_is_refused_by_name() {
    let to = tempfile::tempdir().unwrap();
    let [plain, mixed] = ["plain", "mixed"].map(|name| to.path().join(name));
    let import_with = |sign: fn(&str) -> f64, data: &Path| {
        let from = folder_of_bvh();
        for (path, bytes) in files(from.path()) {
            let Ok(bvh) = Bvh::parse(std::str::from_utf8(&bytes).unwrap()) else { continue };
            let sign = sign(path.file_stem().unwrap().to_str().unwrap());
            fs::write(&path, by_places(&bvh, sign).to_string()).unwrap();
        }
        import(&options(from.path(), Form::Bvh), data).unwrap()
    };
    assert_eq!(import_with(|_| 1.0, &plain).problems, [""; 0]);
    let mixed_in = import_with(|name| if name == "bow_01" { -1.0 } else { 1.0 }, &mixed);
    let [problem] = &mixed_in.problems[..] else { panic!("{:?}", mixed_in.problems) };
    assert!(problem.starts_with("bow_01.bvh: has its toes behind"), "{problem}");
    for id in ["run_01", "turn_01", "walk_01", "walk_02"] {
        assert!(largest(&places(&plain, id), &places(&mixed, id)) < 1e-4, "{id}");
    }
}

#[test]
fn a_file_with_other_offsets_is_of_a_skeleton_of_its_own() {
    let from = folder_of_bvh();
    let to = tempfile::tempdir().unwrap();
    let [plain, mixed, mirrored] = ["plain", "mixed", "mirrored"].map(|name| to.path().join(name));
    import(&options(from.path(), Form::Bvh), &plain).unwrap();
    // Sorts first, so that it would serve all.
    let path = from.path().join("bow_01.bvh");
    let bow = Bvh::parse(&fs::read_to_string(&path).unwrap()).unwrap();
    let quarter = quarter_turned(&bow);
    for turned in [&quarter, &quarter_turned(&quarter)] {
        fs::write(&path, turned.to_string()).unwrap();
        let again = ImportOptions { overwrite: true, ..options(from.path(), Form::Bvh) };
        let imported = import(&again, &mixed).unwrap();
        assert_eq!((imported.problems.len(), imported.remarks.len()), (0, 0));
        assert_all_alike(&plain, &mixed);
    }
    // One that is mirrored with its names kept is refused by name, and the others are as they were.
    let mut other = bow.clone();
    let mirror = |[x, y, z]: [f64; 3]| [-x, y, z];
    let mut column = 0;
    for joint in &mut other.joints {
        joint.offset = mirror(joint.offset);
        joint.end_sites.iter_mut().for_each(|end| *end = mirror(*end));
        for channel in &joint.channels {
            let flipped = [
                Channel::Position(Axis::X),
                Channel::Rotation(Axis::Y),
                Channel::Rotation(Axis::Z),
            ];
            if flipped.contains(channel) {
                other.frames.iter_mut().for_each(|frame| frame[column] = -frame[column]);
            }
            column += 1;
        }
    }
    fs::write(&path, other.to_string()).unwrap();
    let imported = import(&options(from.path(), Form::Bvh), &mirrored).unwrap();
    let [problem] = &imported.problems[..] else { panic!("{:?}", imported.problems) };
    assert!(problem.starts_with("bow_01.bvh: has its toes behind"), "{problem}");
    assert!(largest(&places(&plain, "run_01"), &places(&mirrored, "run_01")) < 1e-4);
}
