//! [`clean_feet`]: feet that slide on the floor are pinned to it, by two-bone inverse kinematics of the legs.
//!
//! The root, the trunk and the arms stay as they are, and so do the lengths of all bones and the turn of each foot.

use std::f64::consts::PI;
use std::ops::Range;

use super::features::{POSITIONS, still_m2};
use super::geometry::{Point, Yaw, add, cross, dot, norm, scale, sub, with_length};
use super::join::{complete_stretches, headings};
use super::{CONTACT_JOINTS, N_FEATURES, PARENTS, Pose, recover_joints};

/// A foot whose toe is below this height, in metres, is on the floor.
pub const ON_FLOOR: f32 = 0.05;

/// Seconds over which a foot goes over to its place before a contact, and back after it.
const FADE_S: f64 = 0.2;
/// A toe that stays low and is fast for no longer than this stays in contact.
const GAP_S: f64 = 0.1;
/// Shorter contacts are none.
const SHORTEST_S: f64 = 0.15;
/// A contact in which the toe travels farther than this from its place, in metres, is left as it is: the body glides,
/// and a foot that stayed would stretch the leg.
const FARTHEST: f64 = 0.25;
/// A leg is stretched to this fraction of its length at most, unless it was longer before. Nearer to 1 the knee would
/// jump.
const STRETCH: f64 = 0.995;
/// The knee of a straight leg bends towards the toes: by as much as the foot moves, in metres, at most.
const FORWARD: f64 = 0.02;

/// The displacements of [`clean_feet`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MovedFeet {
    /// Contacts that were pinned, of both feet.
    pub contacts: usize,
    /// Contacts that were left as they are, since the toe travels too far in them.
    pub left: usize,
    /// Distance that a foot was moved by, the mean over the frames in which it moved, in millimetres.
    pub mean_mm: f64,
    /// The largest such distance, in millimetres.
    pub largest_mm: f64,
}

/// Features with each foot in one place during each of its contacts, and what was moved.
///
/// A toe is in contact while it is lower than [`ON_FLOOR`] and slow enough for a contact among the features. Its place
/// is the median of its places in the contact; before and after, the foot goes over to it and back by half a cosine.
/// Only x and z of knee, ankle and toe change, and the height of the knee. Where the leg is too short the foot comes as
/// near as it can. Rotations, velocities and contacts of the frames that moved are computed again from positions.
///
/// # Shapes
/// Row-major `[T, 263]`, not normalised, to the same.
///
/// # Panics
/// If `features` does not consist of whole rows.
pub fn clean_feet(features: &[f32], fps: f64) -> (Vec<f32>, MovedFeet) {
    let poses = recover_joints(features);
    let headings = headings(features);
    let mut cleaned = features.to_vec();
    let (mut moved, mut distances) = (MovedFeet::default(), Vec::new());
    // Of ankle and toe of each foot, the toes.
    for toe in [CONTACT_JOINTS[1], CONTACT_JOINTS[3]] {
        let wanted = wanted(&poses, toe, fps, &mut moved);
        let rows = cleaned.chunks_exact_mut(N_FEATURES).zip(&headings).zip(&wanted);
        for ((row, heading), wanted) in rows.filter(|(_, wanted)| **wanted != [0.0; 2]) {
            let (x, z) = Yaw::from_half_angle(*heading).rotate_xz(wanted[0], wanted[1]);
            distances.push(1000.0 * move_foot(row, toe, [x, 0.0, z]));
        }
    }
    let rows = features.chunks_exact(N_FEATURES).zip(cleaned.chunks_exact(N_FEATURES));
    let weights: Vec<f64> =
        rows.map(|(a, b)| f64::from(u8::from(a[POSITIONS] != b[POSITIONS]))).collect();
    complete_stretches(&mut cleaned, &weights, fps);
    if !distances.is_empty() {
        moved.mean_mm = distances.iter().sum::<f64>() / distances.len() as f64;
        moved.largest_mm = distances.into_iter().fold(0.0, f64::max);
    }
    (cleaned, moved)
}

// Where a foot should go.

/// The displacement of a toe along x and z in each frame, in metres of the room.
fn wanted(poses: &[Pose], toe: usize, fps: f64, moved: &mut MovedFeet) -> Vec<[f64; 2]> {
    let path: Vec<[f64; 2]> =
        poses.iter().map(|pose| [pose[toe][0], pose[toe][2]].map(f64::from)).collect();
    let mut wanted = vec![[0.0; 2]; path.len()];
    let mut pinned: Vec<Range<usize>> = Vec::new();
    for contact in contacts(poses, toe, fps) {
        let place = [0, 1].map(|axis| median(path[contact.clone()].iter().map(|at| at[axis])));
        let off = |at: &[f64; 2]| [place[0] - at[0], place[1] - at[1]];
        let away = |at: &[f64; 2]| off(at)[0].hypot(off(at)[1]);
        if path[contact.clone()].iter().map(away).fold(0.0, f64::max) > FARTHEST {
            moved.left += 1;
            continue;
        }
        for frame in contact.clone() {
            wanted[frame] = off(&path[frame]);
        }
        pinned.push(contact);
    }
    moved.contacts += pinned.len();
    fade(&mut wanted, &pinned, (FADE_S * fps).round() as usize);
    wanted
}

/// The frames of each contact of a toe.
fn contacts(poses: &[Pose], toe: usize, fps: f64) -> Vec<Range<usize>> {
    let still_m2 = still_m2(fps);
    let steps = poses.windows(2).map(|step| [step[0][toe], step[1][toe]]);
    let low = |[a, b]: &[[f32; 3]; 2]| a[1].max(b[1]) < ON_FLOOR;
    let slow = |[a, b]: &[[f32; 3]; 2]| {
        let step = sub(*b, *a);
        dot(step, step) < still_m2
    };
    let steps: Vec<[bool; 2]> = steps.map(|step| [low(&step), low(&step) && slow(&step)]).collect();
    let frames = |seconds: f64| (seconds * fps).round() as usize;
    let mut found: Vec<Range<usize>> = Vec::new();
    for step in (0..steps.len()).filter(|&step| steps[step][1]) {
        match found.last_mut() {
            Some(last) if is_gap(&steps[last.end..step], frames(GAP_S)) => last.end = step + 1,
            _ => found.push(step..step + 1),
        }
    }
    found.retain(|steps| steps.len() >= frames(SHORTEST_S));
    // n steps join n + 1 frames.
    found.into_iter().map(|steps| steps.start..steps.end + 1).collect()
}

/// Whether a toe that is too fast for a contact in some steps stays in it.
fn is_gap(steps: &[[bool; 2]], longest: usize) -> bool {
    steps.len() <= longest && steps.iter().all(|[low, _]| *low)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

/// Lets the displacement at either end of each contact fade out over some frames, at most to the next contact.
fn fade(wanted: &mut [[f64; 2]], pinned: &[Range<usize>], longest: usize) {
    let n = wanted.len();
    for (i, contact) in pinned.iter().enumerate() {
        let before = i.checked_sub(1).map_or(0, |i| pinned[i].end);
        let after = pinned.get(i + 1).map_or(n, |next| next.start);
        let [first, last] = [contact.start, contact.end - 1].map(|frame| wanted[frame]);
        let before = (before..contact.start).rev().map(|frame| (frame, first));
        let after = (contact.end..after).map(|frame| (frame, last));
        let sides: [Vec<_>; 2] = [before.collect(), after.collect()];
        for side in sides {
            let over = side.len().min(longest);
            for (k, (frame, from)) in side.into_iter().take(over).enumerate() {
                let weight = 0.5 + 0.5 * (PI * (k + 1) as f64 / (over + 1) as f64).cos();
                (0..2).for_each(|axis| wanted[frame][axis] += weight * from[axis]);
            }
        }
    }
}

// The leg.

/// Moves ankle and toe of a row by `wanted`, seen from the body, as far as the leg reaches, and the knee with them;
/// gives the distance in metres.
fn move_foot(row: &mut [f32], toe: usize, wanted: Point) -> f64 {
    let parent = |joint: usize| PARENTS[joint].expect("a leg hangs from the pelvis");
    let (ankle, knee) = (parent(toe), parent(parent(toe)));
    let leg = [parent(knee), knee, ankle, toe].map(|joint| at(row, joint));
    let moved = reach(leg, wanted);
    let bent = bend(leg, moved);
    put(row, knee, bent);
    put(row, ankle, add(leg[2], moved));
    put(row, toe, add(leg[3], moved));
    norm(moved)
}

/// Columns of a joint's place, seen from the body.
fn columns(joint: usize) -> Range<usize> {
    let start = POSITIONS.start + 3 * (joint - 1);
    start..start + 3
}

fn at(row: &[f32], joint: usize) -> Point {
    let place: [f32; 3] = row[columns(joint)].try_into().expect("three columns");
    place.map(f64::from)
}

fn put(row: &mut [f32], joint: usize, place: Point) {
    row[columns(joint)].copy_from_slice(&place.map(|c| c as f32));
}

/// The part of `wanted` by which the ankle can move, the hip staying where it is.
///
/// The largest `s` in 0 to 1 with `|a + s w| ≤ r` for the way `a` from hip to ankle; nothing where the leg cannot be as
/// short as that.
fn reach([hip, knee, ankle, _]: [Point; 4], wanted: Point) -> Point {
    let way = sub(ankle, hip);
    let [thigh, shin] = [norm(sub(knee, hip)), norm(sub(ankle, knee))];
    let radius = (STRETCH * (thigh + shin)).max(norm(way));
    let after = norm(add(way, wanted));
    if after <= (thigh - shin).abs() {
        return [0.0; 3];
    }
    if after <= radius {
        return wanted;
    }
    let (a, b) = (dot(wanted, wanted), dot(way, wanted));
    let c = dot(way, way) - radius * radius;
    let s = ((b * b - a * c).max(0.0).sqrt() - b) / a;
    scale(wanted, s.clamp(0.0, 1.0))
}

/// The knee's place if the ankle has `moved`: at its distances from hip and ankle, on the side of the leg where it was.
///
/// A leg that was straight has no such side, and bends towards the toes.
fn bend([hip, knee, ankle, toe]: [Point; 4], moved: Point) -> Point {
    let [thigh, shin] = [norm(sub(knee, hip)), norm(sub(ankle, knee))];
    let way = sub(add(ankle, moved), hip);
    let between = norm(way);
    let Some(along) = with_length(way, 1.0) else { return knee };
    // The law of cosines: the knee's place along the way, and its distance from it.
    let ahead = (thigh * thigh - shin * shin + between * between) / (2.0 * between);
    let aside = (thigh * thigh - ahead * ahead).max(0.0).sqrt();
    let forward = with_length(across(sub(toe, ankle), along), norm(moved).min(FORWARD));
    let side = add(turned_side([hip, knee, ankle], along), forward.unwrap_or_default());
    // A body faces +z.
    let facing = || with_length(across([0.0, 0.0, 1.0], along), aside);
    let side = with_length(across(side, along), aside).or_else(facing).unwrap_or_default();
    add(hip, add(scale(along, ahead), side))
}

/// The way of the knee from the line between hip and ankle, turned as this line turns to `along`.
fn turned_side([hip, knee, ankle]: [Point; 3], along: Point) -> Point {
    let Some(before) = with_length(sub(ankle, hip), 1.0) else { return sub(knee, hip) };
    let side = across(sub(knee, hip), before);
    // The shortest rotation: v + u × v + u × (u × v) / (1 + cos), with u = before × along.
    let axis = cross(before, along);
    let once = cross(axis, side);
    let twice = scale(cross(axis, once), 1.0 / (1.0 + dot(before, along)).max(1e-9));
    add(side, add(once, twice))
}

/// The part of `v` at right angles to the unit vector `along`.
fn across(v: Point, along: Point) -> Point {
    sub(v, scale(along, dot(v, along)))
}

#[cfg(test)]
mod tests;
