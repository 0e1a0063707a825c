//! Rotations as three turns about axes, without jumps from frame to frame.

use std::f64::consts::{PI, TAU};

use super::hierarchy::Axis;
use crate::motion::{Quat, rotate};

/// Below this cosine of the middle angle, the outer turns share their axis.
const LOCKED: f64 = 1e-6;

/// Three different axes: `R = R_0(a) R_1(b) R_2(c)`.
pub type Order = [Axis; 3];

/// The order whose middle turn is about `axis`.
///
/// The outer turns fall together where the middle one is by 90°. A smallest rotation of a vector
/// along `axis` comes there only where the vector is turned right round, so limbs that rest along
/// their middle axis are free of it.
pub fn order_around(axis: Axis) -> Order {
    match axis {
        Axis::X => [Axis::Z, Axis::X, Axis::Y],
        Axis::Y => [Axis::Z, Axis::Y, Axis::X],
        Axis::Z => [Axis::Y, Axis::Z, Axis::X],
    }
}

/// The angles in radians that give `rotation`, those nearest to `before` of all that do.
///
/// Two triples within a whole turn give each rotation, `(a, b, c)` and `(a + π, π − b, c + π)`.
/// Where the outer turns share their axis, the first keeps its angle.
pub fn angles(rotation: Quat, order: Order, before: [f64; 3]) -> [f64; 3] {
    let m = Turned::of(rotation, order);
    let first = if m.m[1][2].hypot(m.m[2][2]) < LOCKED {
        before[0]
    } else {
        (-m.parity * m.m[1][2]).atan2(m.m[2][2])
    };
    let [near, far] = [first, first + PI].map(|a| unwrapped(m.after(a), before));
    if distance(near, before) <= distance(far, before) { near } else { far }
}

/// A rotation matrix with rows and columns in the order of the turns.
struct Turned {
    m: [[f64; 3]; 3],
    /// 1 for axes in the order of x y z, −1 for the reverse.
    parity: f64,
}

impl Turned {
    fn of(rotation: Quat, order: Order) -> Turned {
        let columns = order.map(|axis| rotate(rotation, axis.unit()));
        let m = std::array::from_fn(|i| columns.map(|column| column[order[i] as usize]));
        let forward = (order[0] as usize + 1) % 3 == order[1] as usize;
        Turned { m, parity: if forward { 1.0 } else { -1.0 } }
    }

    /// All three angles, where the first is `a`: what is left are two turns.
    fn after(&self, a: f64) -> [f64; 3] {
        let (sin, cos) = (self.parity * a).sin_cos();
        let second = |column: usize| cos * self.m[1][column] + sin * self.m[2][column];
        let third = |column: usize| cos * self.m[2][column] - sin * self.m[1][column];
        let b = (self.parity * self.m[0][2]).atan2(third(2));
        let c = (self.parity * second(0)).atan2(second(1));
        [a, b, c]
    }
}

/// Whole turns away from `angles`, each within half a turn of `before`.
fn unwrapped(angles: [f64; 3], before: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| angles[i] - TAU * ((angles[i] - before[i]) / TAU).round())
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::multiply;
    use proptest::prelude::*;

    fn turn(axis: Axis, angle: f64) -> Quat {
        let [x, y, z] = axis.unit().map(|c| c * (angle / 2.0).sin());
        [(angle / 2.0).cos(), x, y, z]
    }

    fn composed(order: Order, [a, b, c]: [f64; 3]) -> Quat {
        multiply(multiply(turn(order[0], a), turn(order[1], b)), turn(order[2], c))
    }

    fn same(a: Quat, b: Quat) -> bool {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>().abs() > 1.0 - 1e-9
    }

    proptest! {
        #[test]
        fn angles_give_the_rotation_and_stay_near(
            axis in 0usize..3,
            at in prop::array::uniform3(-9.0..9.0f64),
            step in prop::array::uniform3(-0.3..0.3f64),
        ) {
            let order = order_around(Axis::ALL[axis]);
            let next = std::array::from_fn(|i| at[i] + step[i]);
            let found = angles(composed(order, next), order, at);
            prop_assert!(same(composed(order, found), composed(order, next)));
            // No further than the angles from which the rotation was made.
            let [found, made] = [found, next].map(|angles| distance(angles, at));
            prop_assert!(found <= made + 1e-6, "{found} {made}");
        }
    }

    #[test]
    fn where_the_outer_turns_share_their_axis_the_first_keeps_its_angle() {
        for axis in Axis::ALL {
            let (order, before) = (order_around(axis), [0.4, std::f64::consts::FRAC_PI_2, 0.1]);
            let rotation = composed(order, [0.9, std::f64::consts::FRAC_PI_2, 0.6]);
            let found = angles(rotation, order, before);
            assert!((found[0] - 0.4).abs() < 1e-9, "{found:?}");
            assert!(same(composed(order, found), rotation), "{found:?}");
        }
    }
}
