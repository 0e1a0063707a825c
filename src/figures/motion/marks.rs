//! The stick figure: limbs by side, a head, and a nose that shows the facing direction.

use super::room::{Seen, length, path, see};
use crate::figures::scene::{Anchor, Point, Scene, plain_text};
use crate::figures::style::{INK, LEFT_SIDE, RIGHT_SIDE, Rgb, Weight, measure, wrap};
use crate::motion::{CHAINS, L_HIP, L_SHOULDER, Pose, R_HIP, R_SHOULDER};

/// Radius of the head, metres.
pub const HEAD_RADIUS: f64 = 0.1;
/// The drawing lies within this many metres of a joint, seen from the side.
pub const REACH: f64 = 0.18;
/// Distance of the nose from the middle of the head, metres.
const NOSE: f64 = 0.16;
/// Metres.
const LIMB_WIDTH: f64 = 0.045;
const TRUNK_WIDTH: f64 = 0.055;
/// The joint in the middle of the head.
const HEAD: usize = 15;

/// Joints that one line joins, or the nose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Part {
    /// A chain of joints.
    Limb(&'static [usize]),
    /// From the middle of the head to the front.
    Nose,
}

/// A line of the figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    pub part: Part,
    pub colour: Rgb,
    /// Metres.
    pub width: f64,
}

/// Every line of the figure: right leg, left leg, trunk, right arm, left arm, nose.
const STROKES: [Stroke; 6] = [
    Stroke { part: Part::Limb(CHAINS[0]), colour: RIGHT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[1]), colour: LEFT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[2]), colour: INK, width: TRUNK_WIDTH },
    Stroke { part: Part::Limb(CHAINS[3]), colour: RIGHT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Limb(CHAINS[4]), colour: LEFT_SIDE, width: LIMB_WIDTH },
    Stroke { part: Part::Nose, colour: INK, width: LIMB_WIDTH },
];

impl Stroke {
    /// The corners of the line in a pose.
    pub fn corners(&self, pose: &Pose) -> Vec<Seen> {
        match self.part {
            Part::Limb(joints) => joints.iter().map(|&j| see(pose[j].map(f64::from))).collect(),
            Part::Nose => {
                let (at, [x, z]) = (pose[HEAD].map(f64::from), front(pose));
                vec![see(at), see([at[0] + NOSE * x, at[1], at[2] + NOSE * z])]
            }
        }
    }

    /// Whether the head is drawn with the line.
    pub fn has_head(&self) -> bool {
        matches!(self.part, Part::Limb(joints) if joints.contains(&HEAD))
    }

    /// How near the viewer the line is in the mean.
    fn nearness(&self, pose: &Pose) -> f64 {
        let corners = self.corners(pose);
        corners.iter().map(|seen| seen.near).sum::<f64>() / corners.len() as f64
    }
}

/// The middle of the head.
pub fn head(pose: &Pose) -> Seen {
    see(pose[HEAD].map(f64::from))
}

/// The horizontal direction `left × up` in which hips and shoulders face, of length 1; a body that
/// lies on its side, and faces nowhere, gets no direction.
fn front(pose: &Pose) -> [f64; 2] {
    let left = |c: usize| {
        f64::from(pose[L_HIP][c] - pose[R_HIP][c] + pose[L_SHOULDER][c] - pose[R_SHOULDER][c])
    };
    let (x, z) = (-left(2), left(0));
    let length = x.hypot(z);
    if length > 1e-6 { [x / length, z / length] } else { [0.0; 2] }
}

/// The strokes of a motion, the farthest first by their mean over `poses`.
pub fn far_to_near(poses: &[Pose]) -> Vec<Stroke> {
    let nearness = |stroke: &Stroke| poses.iter().map(|pose| stroke.nearness(pose)).sum::<f64>();
    let mut strokes = STROKES.to_vec();
    strokes.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    strokes
}

// Text on the pages of motions: a caption as a title, facts, and the colours of the sides.

/// `caption` on one line of plain text: characters that no SVG may hold are blanks.
pub fn cleaned(caption: &str) -> String {
    let plain =
        caption.replace(|c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}'), " ");
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A cleaned caption in bold lines no wider than `width`; words that are wider are cut.
fn lines(caption: &str, em: f64, width: f64) -> Vec<String> {
    let words: Vec<String> =
        cleaned(caption).split(' ').flat_map(|word| pieces(word, em, width)).collect();
    wrap(&words.join(" "), Weight::Bold, em, width)
}

/// A word in pieces no wider than `width`.
fn pieces(word: &str, em: f64, width: f64) -> Vec<String> {
    let mut pieces: Vec<String> = Vec::new();
    for letter in word.chars() {
        let fits = |piece: &String| measure(&format!("{piece}{letter}"), Weight::Bold, em) <= width;
        match pieces.last_mut() {
            Some(piece) if fits(piece) => piece.push(letter),
            _ => pieces.push(letter.to_string()),
        }
    }
    pieces
}

/// Writes a caption from `at` downwards; returns its lower end.
pub fn write(scene: &mut Scene, caption: &str, em: f64, at: Point, width: f64) -> f64 {
    let text = plain_text("", at, Anchor::Start, em).bold();
    scene.lines(lines(caption, em, width), 1.35 * em, &text)
}

/// The facts of a motion: "6.4 s, 20 frames per second, path 4.2 m".
pub fn facts(poses: &[Pose], fps: f32) -> String {
    let seconds = poses.len() as f64 / f64::from(fps);
    let metres = length(&path(poses));
    format!("{seconds:.1} s, {fps} frames a second, path {metres:.1} m")
}

/// Writes "left side" and "right side" in their colours, from `at` to the right.
pub fn sides(scene: &mut Scene, (mut x, y): Point, em: f64) {
    for (content, colour) in [("left side", LEFT_SIDE), ("right side", RIGHT_SIDE)] {
        scene.text(plain_text(content, (x, y), Anchor::Start, em).bold().coloured(colour));
        x += measure(content, Weight::Bold, em) + 16.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{JOINT_NAMES, N_JOINTS};

    #[test]
    fn colours_are_those_of_the_side() {
        for stroke in STROKES {
            let Part::Limb(joints) = stroke.part else { continue };
            let colour = match JOINT_NAMES[joints[joints.len() - 1]].split('_').next() {
                Some("left") => LEFT_SIDE,
                Some("right") => RIGHT_SIDE,
                _ => INK,
            };
            assert_eq!(stroke.colour, colour, "{joints:?}");
        }
    }

    #[test]
    fn a_body_with_its_left_to_x_faces_z() {
        let mut pose = [[0.0; 3]; N_JOINTS];
        (pose[L_HIP], pose[R_HIP]) = ([0.1, 0.9, 0.0], [-0.1, 0.9, 0.0]);
        assert_eq!(front(&pose), [0.0, 1.0]);
        assert_eq!(front(&[[0.0; 3]; N_JOINTS]), [0.0, 0.0]);
    }

    #[test]
    fn the_side_towards_the_viewer_is_drawn_last() {
        let mut pose = [[0.0; 3]; N_JOINTS];
        for joint in 1..N_JOINTS {
            let side = JOINT_NAMES[joint].split('_').next();
            pose[joint][0] =
                f32::from(i8::from(side == Some("left")) - i8::from(side == Some("right")));
        }
        let order = far_to_near(&[pose]);
        assert_eq!(order[0].colour, LEFT_SIDE);
        assert_eq!(order[5].colour, RIGHT_SIDE);
    }
}

#[cfg(test)]
mod caption_tests {
    use super::*;
    use crate::figures::formats::escaped;

    #[test]
    fn every_line_fits_even_of_a_word_that_does_not() {
        let caption = format!("a\tperson\nwalks {}", "o".repeat(200));
        let lines = lines(&caption, 14.0, 300.0);
        assert!(lines.len() > 3);
        assert!(lines.iter().all(|line| measure(line, Weight::Bold, 14.0) <= 300.0));
        assert_eq!(lines.concat().matches('o').count(), 201);
        assert!(lines[0].starts_with("a person walks"));
    }

    #[test]
    fn what_xml_reads_as_its_own_is_escaped() {
        assert_eq!(escaped(&cleaned("a <b> & \u{0}c")), "a &lt;b&gt; &amp; c");
    }
}
