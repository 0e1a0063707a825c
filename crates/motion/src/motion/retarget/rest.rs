//! The trunk and the feet of HumanML3D's skeleton, standing upright and facing +z.

use crate::motion::vector::Point;

/// From its parent to each joint that keeps its place in the parent's frame, metres: x to the left, y up.
///
/// The means over 16,202 standing frames of CMU's captures on HumanML3D's skeleton, each turned to face +z;
/// the middle of the body is at x = 0. Lengths follow from [`BONE_LENGTHS`](crate::motion::BONE_LENGTHS).
/// Thighs, shins and arms are not among them: they lie as the file's own.
pub const REST: [(usize, Point); 13] = [
    (1, [0.0599, -0.0836, -0.0052]),
    (2, [-0.0637, -0.0891, -0.0082]),
    (3, [0.0, 0.1277, -0.0311]),
    (6, [0.0, 0.1418, -0.0131]),
    (9, [0.0, 0.0522, 0.0233]),
    (10, [0.0377, -0.0576, 0.1230]),
    (11, [-0.0439, -0.0556, 0.1289]),
    (12, [0.0, 0.2160, -0.0346]),
    (13, [0.0747, 0.1118, -0.0273]),
    (14, [-0.0735, 0.1198, -0.0271]),
    (15, [0.0, 0.0612, 0.0775]),
    (16, [0.1242, 0.0414, -0.0112]),
    (17, [-0.1155, 0.0410, -0.0083]),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::vector::norm;
    use crate::motion::{BONE_LENGTHS, MIRROR_PARTNER};

    #[test]
    fn bones_have_their_lengths_and_sides() {
        for (joint, rest) in REST {
            assert!((norm(rest) - f64::from(BONE_LENGTHS[joint])).abs() < 5e-3, "joint {joint}");
            let is_partner = |(other, _): &&(usize, Point)| *other == MIRROR_PARTNER[joint];
            let (_, partner) = REST.iter().find(is_partner).unwrap();
            assert!(rest[0] * partner[0] <= 0.0, "joint {joint}");
        }
    }
}
