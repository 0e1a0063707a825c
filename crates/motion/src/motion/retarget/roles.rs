//! Assigns the joints of a file to the joints of HumanML3D's skeleton, by name and by place in the hierarchy.

use crate::motion::bvh::{Bvh, BvhJoint};
use crate::motion::{JOINT_NAMES, N_JOINTS};

/// For each of the 22 joints the index of the file's joint, if any.
pub type Roles = [Option<usize>; N_JOINTS];

/// A mapping from joints of the skeleton to names of joints in the file.
pub type NameMap = Vec<(usize, String)>;

/// Why the joints of a file cannot be mapped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RoleError {
    /// The file has no joint for some that are needed.
    #[error("has no joint that is clearly the {}; its joints are {}", missing.join(", "), joints.join(", "))]
    Missing { missing: Vec<&'static str>, joints: Vec<String> },
    /// A mapping names a joint that the file has not.
    #[error("has no joint named {name:?}, which the mapping gives for {role}")]
    NoSuchJoint { name: String, role: &'static str },
}

/// Names of the parts of a side in the conventions that are known, the surest first, by the left joint's index.
const PARTS: [(usize, &[&str]); 8] = [
    (1, &["thigh", "upleg", "upperleg", "hip"]),
    (4, &["knee", "shin", "calf", "lowerleg", "lowleg", "leg"]),
    (7, &["ankle", "foot"]),
    (10, &["toebase", "toes", "toe", "toe0", "ball"]),
    (13, &["collar", "collarbone", "clavicle"]),
    (16, &["upperarm", "uparm", "shldr", "arm", "shoulder"]),
    (18, &["elbow", "forearm", "lowerarm", "lowarm"]),
    (20, &["wrist", "hand"]),
];
const HEAD: [&str; 2] = ["head", "face"];

/// Joints that a body cannot do without.
const NEEDED: [usize; 14] = [0, 1, 2, 4, 5, 7, 8, 15, 16, 17, 18, 19, 20, 21];

/// The joints of a hierarchy with roles in the skeleton, by `map`, by name, and by place: the pelvis is the joint where
/// the thighs branch off, the chest where the shoulders branch off.
///
/// Names of Bandai Namco, CMU, LaFAN1, Mixamo, Biped, SMPL and Blender are known. A hand or a head without a joint is the
/// End Site of its parent.
///
/// # Errors
/// [`RoleError`].
pub fn roles_of(joints: &[BvhJoint], map: &NameMap) -> Result<Roles, RoleError> {
    let roles = suggested(joints, map)?;
    let missing = NEEDED.into_iter().filter(|role| roles[*role].is_none());
    let missing: Vec<&str> = missing.map(|role| JOINT_NAMES[role]).collect();
    if missing.is_empty() {
        return Ok(roles);
    }
    Err(RoleError::Missing { missing, joints: joints.iter().map(|j| j.name.clone()).collect() })
}

/// A mapping file: found joints, and blanks.
pub fn draft(joints: &[BvhJoint], map: &NameMap) -> String {
    let roles = suggested(joints, map).unwrap_or_default();
    let mut text = String::from(
        "# Joint of the skeleton: name of the file's joint. A line may go where the file has none,\n\
         # but for hips, knees, ankles, shoulders, elbows, wrists and head.\n",
    );
    for (role, name) in JOINT_NAMES.iter().enumerate() {
        text += &match roles[role] {
            Some(joint) => format!("{name}: {:?}\n", joints[joint].name),
            None => format!("# {name}: \n"),
        };
    }
    text += "# The file's joints:\n";
    text.extend(joints.iter().map(|joint| format!("#   {}\n", joint.name)));
    text
}

fn suggested(joints: &[BvhJoint], map: &NameMap) -> Result<Roles, RoleError> {
    let mut roles = by_name(joints);
    for (role, name) in map {
        let joint = joints.iter().position(|joint| joint.name == *name);
        let error = || RoleError::NoSuchJoint { name: name.clone(), role: JOINT_NAMES[*role] };
        roles[*role] = Some(joint.ok_or_else(error)?);
    }
    let told: Vec<usize> = map.iter().map(|(role, _)| *role).collect();
    by_place(joints, &mut roles, &told);
    Ok(roles)
}

fn by_name(joints: &[BvhJoint]) -> Roles {
    let names: Vec<JointName> = joints.iter().map(|joint| JointName::of(&joint.name)).collect();
    let mut roles = [None; N_JOINTS];
    for side in [0, 1] {
        let find = |part: &&str| find(&names, Some(side), part);
        for (role, parts) in PARTS {
            roles[role + side] = parts.iter().find_map(find);
        }
        // `foot` next to an `ankle` is the toe, `shoulder` next to an `arm` the collar bone.
        for (role, part, beside) in [(10, "foot", 7), (13, "shoulder", 16)] {
            let other = find(&part).filter(|&joint| Some(joint) != roles[beside + side]);
            roles[role + side] = roles[role + side].or(other);
        }
    }
    roles[15] = HEAD.iter().find_map(|part| find(&names, None, part));
    roles
}

fn find(names: &[JointName], side: Option<usize>, part: &str) -> Option<usize> {
    let is = |name: &JointName| name.side == side && name.part == part;
    let short = |name: &JointName| name.with_letter_as_side().is_some_and(|name| is(&name));
    names.iter().position(is).or_else(|| names.iter().position(short))
}

/// Fills in roles from the tree: pelvis, spine, neck, and ends of chains.
fn by_place(joints: &[BvhJoint], roles: &mut Roles, told: &[usize]) {
    let shared = |a: Option<usize>, b: Option<usize>| common(joints, a?, b?);
    let set = |roles: &mut Roles, role: usize, joint: Option<usize>| {
        if !told.contains(&role) && joint.is_some() {
            roles[role] = joint;
        }
    };
    let pelvis = shared(roles[1], roles[2]);
    set(roles, 0, pelvis);
    // Wrists are ends of forearms, toes of feet.
    for (role, before) in [(20, 18), (21, 19), (10, 7), (11, 8)] {
        let end = roles[before].and_then(|joint| end_site(joints, joint));
        let joint = roles[role].or(end);
        set(roles, role, joint);
    }
    let chest = shared(roles[16], roles[17]);
    let (Some(pelvis), Some(chest)) = (roles[0], chest) else { return };
    let spine = path(joints, pelvis, chest);
    let at = |i: usize| spine.get(i).or(spine.last()).copied().or(Some(pelvis));
    set(roles, 3, at(0));
    set(roles, 6, at(spine.len() / 2));
    set(roles, 9, at(spine.len().saturating_sub(1)));
    if let Some(head) = roles[15] {
        let neck = path(joints, chest, head).first().copied();
        set(roles, 12, neck);
        if neck == Some(head) {
            set(roles, 15, end_site(joints, head));
        }
    }
}

// The places of joints in a hierarchy.

/// The suffix of the joints made from ends of chains, after their parent's name.
const END: &str = " end";

/// The joint and its ancestors, itself first.
fn ancestors(joints: &[BvhJoint], joint: usize) -> Vec<usize> {
    std::iter::successors(Some(joint), |&joint| joints[joint].parent).collect()
}

/// The nearest common ancestor.
fn common(joints: &[BvhJoint], a: usize, b: usize) -> Option<usize> {
    let of_b = ancestors(joints, b);
    ancestors(joints, a).into_iter().find(|joint| of_b.contains(joint))
}

/// The joints below `from` on the way to `to`, which is the last; none if `to` is no descendant.
fn path(joints: &[BvhJoint], from: usize, to: usize) -> Vec<usize> {
    let up = ancestors(joints, to);
    let Some(at) = up.iter().position(|&joint| joint == from) else { return Vec::new() };
    up[..at].iter().rev().copied().collect()
}

/// The End Site of a joint that has one with a length.
fn end_site(joints: &[BvhJoint], joint: usize) -> Option<usize> {
    let is_end = |child: &BvhJoint| {
        child.parent == Some(joint)
            && child.name.ends_with(END)
            && child.offset.iter().any(|c| c.abs() > 0.0)
    };
    joints.iter().position(is_end)
}

/// The hierarchy with a joint for each End Site, named after the joint that it ends.
pub fn with_ends(mut bvh: Bvh) -> Bvh {
    for parent in 0..bvh.joints.len() {
        for offset in bvh.joints[parent].end_sites.clone() {
            let name = format!("{}{END}", bvh.joints[parent].name);
            let (parent, channels, end_sites) = (Some(parent), Vec::new(), Vec::new());
            bvh.joints.push(BvhJoint { name, parent, offset, channels, end_sites });
        }
    }
    bvh
}

// The side and body part in a joint's name.

/// A joint's name, taken apart.
#[derive(Clone, Debug, PartialEq, Eq)]
struct JointName {
    /// 0 for the left, 1 for the right.
    side: Option<usize>,
    /// The part of the body: lower-case letters and digits, without side and prefix.
    part: String,
}

impl JointName {
    /// Side and part of `mixamorig:LeftUpLeg`, `Bip01 L Thigh`, `upper_arm.L`, `lShldr`, `lhand`, …
    ///
    /// A side is before or after the part. In a name without a side, the last word is the part.
    fn of(name: &str) -> JointName {
        let words = words(name.rsplit(':').next().unwrap_or(name));
        let at = words.iter().position(|word| side(word).is_some());
        let part = match at {
            Some(at) if at + 1 < words.len() => words[at + 1..].concat(),
            Some(at) => words[..at].concat(),
            None => words.last().cloned().unwrap_or_default(),
        };
        JointName { side: at.and_then(|at| side(&words[at])), part }
    }

    /// `lhand` read as the left `hand`, for names without capitals.
    fn with_letter_as_side(&self) -> Option<JointName> {
        let (letter, part) = self.part.split_at_checked(1).filter(|_| self.side.is_none())?;
        Some(JointName { side: Some(side(letter)?), part: part.to_string() })
    }
}

fn side(word: &str) -> Option<usize> {
    match word {
        "left" | "l" => Some(0),
        "right" | "r" => Some(1),
        _ => None,
    }
}

/// Runs of letters and digits in lower case, also split at capitals.
pub fn words(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let mut words: Vec<String> = vec![String::new()];
    for (i, &letter) in letters.iter().enumerate() {
        let before = i.checked_sub(1).map(|i| letters[i]);
        let after = letters.get(i + 1);
        let begins = letter.is_uppercase()
            && (before.is_some_and(char::is_lowercase) || after.is_some_and(|c| c.is_lowercase()));
        if (begins || !letter.is_alphanumeric()) && !words[words.len() - 1].is_empty() {
            words.push(String::new());
        }
        if letter.is_alphanumeric() {
            let last = words.len() - 1;
            words[last].extend(letter.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_seven_conventions_are_read() {
        const LEFT: Option<usize> = Some(0);
        const RIGHT: Option<usize> = Some(1);
        let cases = [
            ("mixamorig:LeftUpLeg", LEFT, "upleg"),
            ("Bip01 L Thigh", LEFT, "thigh"),
            ("upper_arm.R", RIGHT, "upperarm"),
            ("lShldr", LEFT, "shldr"),
            ("RHipJoint", RIGHT, "hipjoint"),
            ("UpperArm_L", LEFT, "upperarm"),
            ("right_wrist", RIGHT, "wrist"),
            ("Character1_RightForeArm", RIGHT, "forearm"),
            ("LeftHandIndex1", LEFT, "handindex1"),
            ("mixamorig_Head", None, "head"),
            ("joint_Root", None, "root"),
            ("lowerneck", None, "lowerneck"),
        ];
        for (name, side, part) in cases {
            assert_eq!(JointName::of(name), JointName { side, part: part.to_string() }, "{name}");
        }
        let hand = JointName::of("rhand").with_letter_as_side();
        assert_eq!(hand, Some(JointName { side: RIGHT, part: "hand".to_string() }));
        assert_eq!(JointName::of("LeftHand").with_letter_as_side(), None);
        assert_eq!(JointName::of("").with_letter_as_side(), None);
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
}
