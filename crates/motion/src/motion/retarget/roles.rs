//! Which joint of a file plays the part of each joint of HumanML3D's skeleton.

use super::names::{JointName, Side};
use super::tree;
use crate::motion::bvh::BvhJoint;
use crate::motion::{JOINT_NAMES, N_JOINTS};

/// For each of the 22 joints the index of the file's joint, where it has one.
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

/// Names of a part in the conventions that are known, the surest first.
const THIGH: &[&str] = &["thigh", "upleg", "upperleg", "hip"];
const KNEE: &[&str] = &["knee", "shin", "calf", "lowerleg", "lowleg", "leg"];
const ANKLE: &[&str] = &["ankle", "foot"];
const TOE: &[&str] = &["toebase", "toes", "toe", "toe0", "ball"];
const SHOULDER: &[&str] = &["upperarm", "uparm", "shldr", "arm", "shoulder"];
const COLLAR: &[&str] = &["collar", "collarbone", "clavicle"];
const ELBOW: &[&str] = &["elbow", "forearm", "lowerarm", "lowarm"];
const WRIST: &[&str] = &["wrist", "hand"];
const HEAD: &[&str] = &["head", "face"];

/// Joints that a body cannot do without.
const NEEDED: [usize; 14] = [0, 1, 2, 4, 5, 7, 8, 15, 16, 17, 18, 19, 20, 21];

/// The joints of a hierarchy that play the parts of the skeleton, by `map`, by their names, and by where
/// they hang: the pelvis is where the thighs part, the chest where the shoulders part.
///
/// Bandai Namco, CMU, LaFAN1, Mixamo, Biped, SMPL and Blender's names are known. A hand or a head without
/// a joint is the End Site of the joint before it.
///
/// # Errors
/// [`RoleError`].
pub fn roles_of(joints: &[BvhJoint], map: &NameMap) -> Result<Roles, RoleError> {
    let roles = suggested(joints, map)?;
    let missing: Vec<&str> = NEEDED
        .iter()
        .filter(|&&role| roles[role].is_none())
        .map(|&role| JOINT_NAMES[role])
        .collect();
    if missing.is_empty() {
        return Ok(roles);
    }
    Err(RoleError::Missing { missing, joints: joints.iter().map(|j| j.name.clone()).collect() })
}

/// A mapping file: what is found, and blanks.
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
    for (side, first) in [(Side::Left, 0), (Side::Right, 1)] {
        let find = |parts: &[&str]| parts.iter().find_map(|part| find(&names, Some(side), part));
        for (role, parts) in
            [(1, THIGH), (4, KNEE), (7, ANKLE), (10, TOE), (13, COLLAR), (16, SHOULDER)]
        {
            roles[role + first] = find(parts);
        }
        (roles[18 + first], roles[20 + first]) = (find(ELBOW), find(WRIST));
        // `foot` beside an `ankle` is the toe, `shoulder` beside an `arm` the collar bone.
        roles[10 + first] =
            roles[10 + first].or(find(&["foot"]).filter(|&j| Some(j) != roles[7 + first]));
        let collar = find(&["shoulder"]).filter(|&j| Some(j) != roles[16 + first]);
        roles[13 + first] = roles[13 + first].or(collar);
    }
    roles[15] = HEAD.iter().find_map(|part| find(&names, None, part));
    roles
}

fn find(names: &[JointName], side: Option<Side>, part: &str) -> Option<usize> {
    let is = |name: &JointName| name.side == side && name.part == part;
    let short = |name: &JointName| name.with_letter_as_side().is_some_and(|name| is(&name));
    names.iter().position(is).or_else(|| names.iter().position(short))
}

/// Fills in what follows from the tree: pelvis, spine, neck, and ends of chains.
fn by_place(joints: &[BvhJoint], roles: &mut Roles, told: &[usize]) {
    let common = |a: Option<usize>, b: Option<usize>| tree::common(joints, a?, b?);
    let set = |roles: &mut Roles, role: usize, joint: Option<usize>| {
        if !told.contains(&role) && joint.is_some() {
            roles[role] = joint;
        }
    };
    let pelvis = common(roles[1], roles[2]);
    set(roles, 0, pelvis);
    for side in [0, 1] {
        let end = roles[18 + side].and_then(|elbow| tree::end(joints, elbow));
        let wrist = roles[20 + side].or(end);
        set(roles, 20 + side, wrist);
        let end = roles[7 + side].and_then(|ankle| tree::end(joints, ankle));
        let toe = roles[10 + side].or(end);
        set(roles, 10 + side, toe);
    }
    let chest = common(roles[16], roles[17]);
    let (Some(pelvis), Some(chest)) = (roles[0], chest) else { return };
    let spine = tree::path(joints, pelvis, chest);
    let at = |i: usize| spine.get(i).or(spine.last()).copied().or(Some(pelvis));
    set(roles, 3, at(0));
    set(roles, 6, at(spine.len() / 2));
    set(roles, 9, at(spine.len().saturating_sub(1)));
    if let Some(head) = roles[15] {
        let neck = tree::path(joints, chest, head).first().copied();
        let (neck, end) =
            if neck == Some(head) { (neck, tree::end(joints, head)) } else { (neck, None) };
        set(roles, 12, neck);
        set(roles, 15, end);
    }
}
