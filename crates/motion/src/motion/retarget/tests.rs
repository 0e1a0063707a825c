use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::motion::Pose;
use crate::motion::bvh::{Bvh, fit_bvh};
use crate::motion::synth::Script;
use crate::motion::vector::{norm, scale, sub};
use crate::motion::{BONE_LENGTHS, JOINT_NAMES, PARENTS, rotate};

/// The first frames of a walk.
fn walk(n: usize) -> Vec<Pose> {
    Script::sample(&mut ChaCha8Rng::seed_from_u64(3)).poses()[..n].to_vec()
}

fn poses64(n: usize) -> Vec<Pose64> {
    walk(n).iter().map(|pose| pose.map(|joint| joint.map(f64::from))).collect()
}

/// A motion as a file of this program's own hierarchy, with a T as the pose of its OFFSETs.
fn own_file(n: usize) -> Bvh {
    with_ends(fit_bvh(&walk(n), 20.0).unwrap().bvh)
}

fn rig_of(bvh: &Bvh) -> Rig {
    let roles = roles_of(&bvh.joints, &NameMap::new()).unwrap();
    let survey = Survey::of(&bvh.placed(), &roles, None);
    Rig::of(&bvh.zero_pose(), roles, &survey, None).unwrap()
}

fn followed(bvh: &Bvh) -> Vec<Pose64> {
    let (frames, rig) = (bvh.placed(), rig_of(bvh));
    let unit_m = unit_m(&frames, &rig).unwrap();
    frames.iter().map(|joints| follow(joints, &rig, unit_m)).collect()
}

fn largest(a: &[Pose64], b: &[Pose64]) -> f64 {
    let joints = a.as_flattened().iter().zip(b.as_flattened());
    joints.map(|(a, b)| norm(sub(*a, *b))).fold(0.0, f64::max)
}

/// Names of joints in the order of a tree, `parent>child`.
fn joints(tree: &[(&str, &str)]) -> Vec<BvhJoint> {
    let index = |name: &str| tree.iter().position(|(own, _)| *own == name);
    let joint = |(name, parent): &(&str, &str)| BvhJoint {
        name: name.to_string(),
        parent: index(parent),
        offset: [0.0, 1.0, 0.0],
        channels: Vec::new(),
        end_sites: Vec::new(),
    };
    tree.iter().map(joint).collect()
}

const MIXAMO: [(&str, &str); 22] = [
    ("mixamorig:Hips", ""),
    ("mixamorig:Spine", "mixamorig:Hips"),
    ("mixamorig:Spine1", "mixamorig:Spine"),
    ("mixamorig:Spine2", "mixamorig:Spine1"),
    ("mixamorig:Neck", "mixamorig:Spine2"),
    ("mixamorig:Head", "mixamorig:Neck"),
    ("mixamorig:LeftShoulder", "mixamorig:Spine2"),
    ("mixamorig:LeftArm", "mixamorig:LeftShoulder"),
    ("mixamorig:LeftForeArm", "mixamorig:LeftArm"),
    ("mixamorig:LeftHand", "mixamorig:LeftForeArm"),
    ("mixamorig:RightShoulder", "mixamorig:Spine2"),
    ("mixamorig:RightArm", "mixamorig:RightShoulder"),
    ("mixamorig:RightForeArm", "mixamorig:RightArm"),
    ("mixamorig:RightHand", "mixamorig:RightForeArm"),
    ("mixamorig:LeftUpLeg", "mixamorig:Hips"),
    ("mixamorig:LeftLeg", "mixamorig:LeftUpLeg"),
    ("mixamorig:LeftFoot", "mixamorig:LeftLeg"),
    ("mixamorig:LeftToeBase", "mixamorig:LeftFoot"),
    ("mixamorig:RightUpLeg", "mixamorig:Hips"),
    ("mixamorig:RightLeg", "mixamorig:RightUpLeg"),
    ("mixamorig:RightFoot", "mixamorig:RightLeg"),
    ("mixamorig:RightToeBase", "mixamorig:RightFoot"),
];

#[test]
fn joints_of_mixamo_play_all_parts() {
    let joints = joints(&MIXAMO);
    let roles = roles_of(&joints, &NameMap::new()).unwrap();
    let name = |role: &str| {
        let role = JOINT_NAMES.iter().position(|name| *name == role).unwrap();
        joints[roles[role].unwrap()].name.trim_start_matches("mixamorig:")
    };
    let expected = [
        ("pelvis", "Hips"),
        ("left_knee", "LeftLeg"),
        ("right_ankle", "RightFoot"),
        ("left_foot", "LeftToeBase"),
        ("spine1", "Spine"),
        ("spine2", "Spine1"),
        ("spine3", "Spine2"),
        ("left_collar", "LeftShoulder"),
        ("right_shoulder", "RightArm"),
        ("right_wrist", "RightHand"),
        ("head", "Head"),
    ];
    for (role, joint) in expected {
        assert_eq!(name(role), joint, "{role}");
    }
}

#[test]
fn a_mapping_overrides_names_and_its_mistakes_are_told() {
    let joints = joints(&MIXAMO);
    let map = |role: usize, name: &str| vec![(role, name.to_string())];
    let roles = roles_of(&joints, &map(12, "mixamorig:Spine2")).unwrap();
    assert_eq!(roles[12], Some(3));
    let error = roles_of(&joints, &map(4, "LeftKnee")).unwrap_err().to_string();
    assert!(
        error.contains("no joint named \"LeftKnee\"") && error.contains("left_knee"),
        "{error}"
    );
    let error = roles_of(&joints[..10], &NameMap::new()).unwrap_err().to_string();
    assert!(error.contains("right_wrist") && error.contains("mixamorig:LeftHand"), "{error}");
    let draft = draft(&joints[..10], &NameMap::new());
    assert!(draft.contains("left_wrist: \"mixamorig:LeftHand\"\n# right_wrist: \n"), "{draft}");
}

#[test]
fn limbs_lie_as_in_the_file_and_bones_have_the_targets_lengths() {
    let bvh = own_file(60);
    let found = followed(&bvh);
    for (pose, truth) in found.iter().zip(poses64(60)) {
        for joint in 1..JOINT_NAMES.len() {
            let parent = PARENTS[joint].unwrap();
            let bone = sub(pose[joint], pose[parent]);
            assert!((norm(bone) - f64::from(BONE_LENGTHS[joint])).abs() < 1e-9);
            if [4, 5, 7, 8, 18, 19, 20, 21].contains(&joint) {
                let own = sub(truth[joint], truth[parent]);
                let off = norm(sub(scale(bone, 1.0 / norm(bone)), scale(own, 1.0 / norm(own))));
                assert!(off < 0.01, "joint {joint}: {off}");
            }
        }
    }
}

#[test]
fn units_axes_and_hands_do_not_matter() {
    let bvh = own_file(40);
    let (frames, rig) = (bvh.placed(), rig_of(&bvh));
    let truth = followed(&bvh);
    // Inches, z up: y becomes z.
    let turn = [std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0];
    let other = |joint: &crate::motion::bvh::Placed| crate::motion::bvh::Placed {
        rotation: crate::motion::multiply(turn, joint.rotation),
        position: scale(rotate(turn, joint.position), 1.0 / 2.54),
    };
    let turned: Vec<Vec<_>> = frames.iter().map(|f| f.iter().map(other).collect()).collect();
    let survey = Survey::of(&turned, &rig.roles, None);
    let own = Rig::of(&bvh.zero_pose(), rig.roles, &survey, None).unwrap();
    assert_eq!(own.up.to_string(), "z");
    let unit = unit_m(&turned, &own).unwrap();
    assert!((unit / unit_m(&frames, &rig).unwrap() - 2.54).abs() < 1e-6);
    let found: Vec<Pose64> = turned.iter().map(|joints| follow(joints, &own, unit)).collect();
    assert!(largest(&found, &truth) < 1e-9, "{}", largest(&found, &truth));
    // A mirrored file has its toes behind, until it is mirrored back.
    let mirrored: Vec<Vec<_>> =
        frames.iter().map(|f| f.iter().copied().map(reflected_joint).collect()).collect();
    let survey = Survey::of(&mirrored, &rig.roles, None);
    let error = Rig::of(&bvh.zero_pose(), rig.roles, &survey, None).unwrap_err();
    assert_eq!(error, RigError::Backwards);
}

#[test]
fn standing_frames_stand_in_for_a_pose_of_offsets_that_is_no_body() {
    let file = |seed: u64| {
        let poses = Script::sample(&mut ChaCha8Rng::seed_from_u64(seed)).poses();
        with_ends(fit_bvh(&poses, 20.0).unwrap().bvh)
    };
    let surveyed = |bvh: Bvh| {
        let roles = rig_of(&bvh).roles;
        let survey = Survey::of(&bvh.placed(), &roles, None);
        (bvh, roles, survey)
    };
    let mut files = (0..).map(|seed| surveyed(file(seed)));
    let (bvh, roles, survey) = files.find(|(.., survey)| survey.standing >= 20).unwrap();
    let (truth, frames) = (followed(&bvh), bvh.placed());
    // All joints in one place: the pose of Bandai Namco's OFFSETs is as useless.
    let mut zero = bvh.zero_pose();
    zero.iter_mut().for_each(|joint| joint.position = [0.0; 3]);
    let rig = Rig::of(&zero, roles, &survey, None).unwrap();
    assert!(matches!(rig.neutral, Neutral::Standing(n) if n >= 10), "{:?}", rig.neutral);
    let unit = unit_m(&frames, &rig).unwrap();
    let found: Vec<Pose64> = frames.iter().map(|joints| follow(joints, &rig, unit)).collect();
    // The trunk's lean over standing frames is taken for upright.
    assert!(largest(&found, &truth) < 0.25, "{}", largest(&found, &truth));
    let none = Survey { standing: 9, ..survey };
    assert_eq!(Rig::of(&zero, roles, &none, None), Err(RigError::NoNeutral(9)));
}

#[test]
fn joints_of_the_target_stay_as_they_are_and_others_take_its_lengths() {
    let poses: Vec<Pose64> = poses64(30).iter().map(with_lengths).collect();
    let same = settled(&poses, None).unwrap();
    assert!(same.unit_m.is_none() && same.poses == poses);
    let centimetres: Vec<Pose64> = poses.iter().map(|p| p.map(|j| scale(j, 100.0))).collect();
    let found = settled(&centimetres, None).unwrap();
    assert!((found.unit_m.unwrap() - 0.01).abs() < 1e-6);
    assert!(largest(&found.poses, &poses) < 1e-5);
    let mirrored: Vec<Pose64> = poses.iter().map(|pose| pose.map(reflected)).collect();
    assert!(settled(&mirrored, None).is_err_and(|error| error == PointsError::Backwards));
    let lying: Vec<Pose64> =
        poses.iter().map(|pose| pose.map(|[x, y, z]| [x + y, y - x, z])).collect();
    assert!(settled(&lying, None).is_err_and(|error| error == PointsError::Up));
}
