//! [`Bvh::to_glb`]: a hierarchy and its frames as a binary glTF 2.0 file, which viewers, browsers and engines play.
//!
//! A joint is a node that the animation turns. A bone is a further node without animation: one octahedron, stretched to
//! the bone's length. The left limbs are vermillion, the right ones blue, as in the SVG. Without normals in the file a
//! viewer shades each face flat (glTF 2.0, 3.7.2.1).

use serde_json::{Value, json};

use super::hierarchy::{Bvh, BvhJoint, CM_PER_M, Channel, local};
use crate::motion::geometry::{Point, align, norm};
use crate::motion::{NO_ROTATION, Quat};

/// Half the width of a bone at its thickest place, metres, and as a share of its length at most.
const HALF_WIDTH: (f64, f64) = (0.03, 0.25);

/// An octahedron along y from 0 to 1, thickest at a fifth; half its width is 1.
const CORNERS: [[f32; 3]; 6] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.2, 0.0],
    [0.0, 0.2, -1.0],
    [-1.0, 0.2, 0.0],
    [0.0, 0.2, 1.0],
    [0.0, 1.0, 0.0],
];
/// Its faces, counter-clockwise from outside.
const FACES: [[u16; 3]; 8] =
    [[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [5, 1, 2], [5, 2, 3], [5, 3, 4], [5, 4, 1]];

/// Linear colours of the trunk, the left and the right side.
const COLOURS: [[f32; 3]; 3] = [[0.25, 0.25, 0.25], [0.665, 0.112, 0.0], [0.0, 0.168, 0.445]];

/// Words of the format: component types, and targets of buffer views.
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

impl Bvh {
    /// The motion as a GLB file: metres and seconds, y up, one animation. The file's unit of length is the centimetre,
    /// as [`fit_bvh`](super::fit_bvh) makes it.
    ///
    /// # Panics
    /// If a frame has another length than [`Bvh::n_channels`].
    pub fn to_glb(&self) -> Vec<u8> {
        let mut data = Data::default();
        let corners = data.floats("VEC3", CORNERS.as_flattened(), Some(VERTICES));
        let faces = data.indices(FACES.as_flattened());
        let mesh = |side: usize| {
            let solid =
                json!({"attributes": {"POSITION": corners}, "indices": faces, "material": side});
            json!({"primitives": [solid]})
        };
        let material = |colour: &[f32; 3]| {
            let [r, g, b] = colour;
            let surface = json!({"baseColorFactor": [r, g, b, 1], "metallicFactor": 0, "roughnessFactor": 0.8});
            json!({"pbrMetallicRoughness": surface})
        };
        let animation = self.animation(&mut data);
        let roots = (0..self.joints.len()).filter(|i| self.joints[*i].parent.is_none());
        let document = json!({
            "asset": {"version": "2.0", "generator": "isoflop"},
            "scene": 0,
            "scenes": [{"nodes": roots.collect::<Vec<_>>()}],
            "nodes": self.nodes(),
            "meshes": (0..COLOURS.len()).map(mesh).collect::<Vec<_>>(),
            "materials": COLOURS.iter().map(material).collect::<Vec<_>>(),
            "animations": [animation],
            "accessors": data.accessors,
            "bufferViews": data.views,
            "buffers": [{"byteLength": data.bytes.len()}],
        });
        container(document.to_string().into_bytes(), data.bytes)
    }

    /// The joints, in their order, then the bones.
    fn nodes(&self) -> Vec<Value> {
        let n = self.joints.len();
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); n];
        let mut bones = Vec::new();
        for (index, joint) in self.joints.iter().enumerate() {
            let parent = joint.parent.map(|parent| (parent, joint.offset));
            let tips = joint.end_sites.iter().map(|tip| (index, *tip));
            if let Some(parent) = joint.parent {
                children[parent].push(index);
            }
            for (from, along) in parent.into_iter().chain(tips) {
                if let Some(bone) = bone(along, side(&joint.name)) {
                    children[from].push(n + bones.len());
                    bones.push(bone);
                }
            }
        }
        let joint = |(joint, children): (&BvhJoint, &Vec<usize>)| {
            let place = joint.offset.map(|c| c / CM_PER_M);
            let mut node = json!({"name": joint.name, "translation": place});
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            node
        };
        self.joints.iter().zip(&children).map(joint).chain(bones).collect()
    }

    /// Rotations of all joints that have some, and places of those with position channels, over time.
    fn animation(&self, data: &mut Data) -> Value {
        let times: Vec<f32> =
            (0..self.frames.len()).map(|t| (t as f64 * self.frame_time_s) as f32).collect();
        let times = data.floats("SCALAR", &times, None);
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        let mut first = 0;
        for (node, joint) in self.joints.iter().enumerate() {
            let own = first..first + joint.channels.len();
            first = own.end;
            let moved: Vec<(Quat, Point)> =
                self.frames.iter().map(|frame| local(joint, &frame[own.clone()])).collect();
            let mut add = |path: &str, values: u32| {
                channels.push(
                    json!({"sampler": samplers.len(), "target": {"node": node, "path": path}}),
                );
                samplers.push(json!({"input": times, "output": values}));
            };
            if joint.channels.iter().any(|channel| matches!(channel, Channel::Rotation(_))) {
                add("rotation", data.floats("VEC4", &turns(&moved), None));
            }
            if joint.channels.iter().any(|channel| matches!(channel, Channel::Position(_))) {
                let places =
                    moved.iter().flat_map(|(_, place)| place.map(|c| (c / CM_PER_M) as f32));
                add("translation", data.floats("VEC3", &places.collect::<Vec<_>>(), None));
            }
        }
        json!({"name": "motion", "channels": channels, "samplers": samplers})
    }
}

/// 0 for the trunk, 1 for the left, 2 for the right side.
fn side(joint: &str) -> usize {
    ["left", "right"]
        .iter()
        .position(|word| joint.to_lowercase().contains(word))
        .map_or(0, |at| at + 1)
}

/// The node of a bone that reaches from its joint to `along`, in centimetres; `None` for one without length.
fn bone(along: Point, mesh: usize) -> Option<Value> {
    let length = norm(along) / CM_PER_M;
    (length > 1e-4).then(|| {
        let half = HALF_WIDTH.0.min(HALF_WIDTH.1 * length);
        let [w, x, y, z] = align(&[[0.0, 1.0, 0.0]], &[along], NO_ROTATION);
        json!({"mesh": mesh, "rotation": [x, y, z, w], "scale": [half, length, half]})
    })
}

/// Quaternions (x, y, z, w) frame by frame. Each has the sign that is nearer to the one before, so that a viewer that
/// interpolates does not take the long way round.
fn turns(moved: &[(Quat, Point)]) -> Vec<f32> {
    let mut before = NO_ROTATION;
    let signed = |(turn, _): &(Quat, Point)| {
        let along: f64 = turn.iter().zip(before).map(|(a, b)| a * b).sum();
        before = if along < 0.0 { turn.map(|c| -c) } else { *turn };
        let [w, x, y, z] = before.map(|c| c as f32);
        [x, y, z, w]
    };
    moved.iter().flat_map(signed).collect()
}

/// The binary part of the file, with its views and accessors.
#[derive(Default)]
struct Data {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Data {
    /// The accessor of numbers of a type: `SCALAR`, `VEC3` or `VEC4`.
    fn floats(&mut self, kind: &str, values: &[f32], target: Option<u32>) -> u32 {
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let bound = |least: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let column = |c: usize| values.iter().skip(c).step_by(width).copied().fold(least, pick);
            (0..width).map(column).collect()
        };
        let (least, most) = (bound(f32::INFINITY, f32::min), bound(f32::NEG_INFINITY, f32::max));
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let accessor = json!({"componentType": FLOAT, "type": kind, "count": values.len() / width, "min": least, "max": most});
        self.add(bytes, target, accessor)
    }

    fn indices(&mut self, corners: &[u16]) -> u32 {
        let bytes = corners.iter().flat_map(|corner| corner.to_le_bytes()).collect();
        let accessor =
            json!({"componentType": UNSIGNED_SHORT, "type": "SCALAR", "count": corners.len()});
        self.add(bytes, Some(INDICES), accessor)
    }

    fn add(&mut self, bytes: Vec<u8>, target: Option<u32>, mut accessor: Value) -> u32 {
        let mut view =
            json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        accessor["bufferView"] = json!(self.views.len());
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.accessors.push(accessor);
        self.accessors.len() as u32 - 1
    }
}

/// A header, a chunk of JSON filled up with spaces, and one of bytes (glTF 2.0, 4.4).
fn container(mut json: Vec<u8>, bytes: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |n: usize| (n as u32).to_le_bytes();
    let length = 12 + 8 + json.len() + 8 + bytes.len();
    let header = [*b"glTF", 2u32.to_le_bytes(), word(length)].concat();
    let chunk = |kind: &[u8; 4], bytes: &[u8]| [&word(bytes.len()), &kind[..], bytes].concat();
    [header, chunk(b"JSON", &json), chunk(b"BIN\0", &bytes)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::bvh::fit_bvh;
    use crate::motion::fixtures::procedural;
    use crate::motion::{JOINT_NAMES, multiply, rotate};
    use gltf::animation::util::ReadOutputs;
    use std::collections::HashMap;

    type Placed = (Quat, Point);

    /// Places and turns of all nodes that have a name, in a frame, as a reader of glTF computes them.
    fn played(file: &gltf::Gltf, frame: usize) -> HashMap<String, Point> {
        let bytes = file.blob.as_deref().expect("a binary part");
        let mut locals: HashMap<usize, Placed> = HashMap::new();
        for node in file.nodes() {
            let (place, [x, y, z, w], _) = node.transform().decomposed();
            locals.insert(node.index(), ([w, x, y, z].map(f64::from), place.map(f64::from)));
        }
        for channel in
            file.animations().flat_map(|animation| animation.channels().collect::<Vec<_>>())
        {
            let of = locals.get_mut(&channel.target().node().index()).unwrap();
            match channel.reader(|_| Some(bytes)).read_outputs().expect("numbers") {
                ReadOutputs::Rotations(turns) => {
                    let [x, y, z, w] = turns.into_f32().nth(frame).unwrap();
                    of.0 = [w, x, y, z].map(f64::from);
                }
                ReadOutputs::Translations(mut places) => {
                    of.1 = places.nth(frame).unwrap().map(f64::from);
                }
                _ => panic!("neither turns nor places"),
            }
        }
        let mut placed = HashMap::new();
        let mut left: Vec<(gltf::Node, Placed)> = file
            .scenes()
            .next()
            .unwrap()
            .nodes()
            .map(|root| (root, (NO_ROTATION, [0.0; 3])))
            .collect();
        while let Some((node, (turn, place))) = left.pop() {
            let (own, by) = locals[&node.index()];
            let by = rotate(turn, by);
            let here = (multiply(turn, own), std::array::from_fn(|c| place[c] + by[c]));
            left.extend(node.children().map(|child| (child, here)));
            if let Some(name) = node.name() {
                placed.insert(name.to_string(), here.1);
            }
        }
        placed
    }

    #[test]
    fn a_reader_of_gltf_finds_the_joints_where_the_hierarchy_has_them() {
        let bvh = fit_bvh(&procedural(7), 20.0).unwrap().bvh;
        let file = gltf::Gltf::from_slice(&bvh.to_glb()).expect("a valid file");
        let poses = bvh.poses().unwrap();
        for frame in [0, poses.len() / 2, poses.len() - 1] {
            let placed = played(&file, frame);
            for (name, joint) in JOINT_NAMES.iter().zip(poses[frame]) {
                let off = (0..3)
                    .map(|c| (placed[*name][c] - f64::from(joint[c])).abs())
                    .fold(0.0, f64::max);
                assert!(off < 1e-4, "{name} in frame {frame}: {off} m");
            }
        }
        let animation = file.animations().next().unwrap();
        let channel = animation.channels().next().unwrap();
        let times: Vec<f32> =
            channel.reader(|_| file.blob.as_deref()).read_inputs().unwrap().collect();
        assert!((times.len(), times[1]) == (poses.len(), 0.05), "{times:?}");
    }

    #[test]
    fn a_bone_reaches_from_its_joint_to_the_next() {
        let bvh = fit_bvh(&procedural(8), 20.0).unwrap().bvh;
        let file = gltf::Gltf::from_slice(&bvh.to_glb()).unwrap();
        let wrist = bvh.joints.iter().find(|joint| joint.name == "left_wrist").unwrap();
        let elbow = file.nodes().find(|node| node.name() == Some("left_elbow")).unwrap();
        let bone = elbow.children().find(|node| node.mesh().is_some()).unwrap();
        let (_, [x, y, z, w], [_, length, _]) = bone.transform().decomposed();
        let tip = rotate([w, x, y, z].map(f64::from), [0.0, f64::from(length), 0.0]);
        let off = (0..3).map(|c| (tip[c] - wrist.offset[c] / CM_PER_M).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6 && bone.mesh().unwrap().index() == 1, "{tip:?} {:?}", wrist.offset);
    }

    #[test]
    fn no_quaternion_turns_against_the_one_before() {
        let bvh = fit_bvh(&procedural(9), 20.0).unwrap().bvh;
        let file = gltf::Gltf::from_slice(&bvh.to_glb()).unwrap();
        let bytes = file.blob.as_deref();
        for channel in file.animations().next().unwrap().channels() {
            if let Some(ReadOutputs::Rotations(turns)) = channel.reader(|_| bytes).read_outputs() {
                let turns: Vec<[f32; 4]> = turns.into_f32().collect();
                assert!(
                    turns
                        .windows(2)
                        .all(|two| (0..4).map(|c| two[0][c] * two[1][c]).sum::<f32>() >= 0.0)
                );
            }
        }
    }
}
