//! Terms of the loss of joints over time: accelerations, and the root's place.
//!
//! # Accelerations
//!
//! Let e be predicted minus true values in metres and radians, p the true positions about the root, and
//!
//! uⱼ(t) = eⱼ(t+1) − eⱼ(t) + (e_x − 2 e_yaw p_z, Δe_height, e_z + 2 e_yaw p_x)(t)
//!
//! the error of joint j's step as it is seen from the true body: its own step, and the step and the turn of the
//! root, which has no position of its own. Heights count where joints stand at heights above the root. With
//! a = u(t) − u(t−1) and A = 5 cm,
//!
//! acceleration = Σ_t mean_j √(1 + ‖a‖² / A²) − 1.
//!
//! u crosses the boundaries of codes as any other frame, so that a jump there costs two large accelerations.
//! It is quadratic for small errors: a term in ‖a‖ would have its least at many small errors and one jump.
//!
//! # The root's place
//!
//! place = Σ_t ‖r(t) − r̂(t)‖ / 0.1 m, where r sums the root's steps, turned by the turns up to each, from the
//! window's first frame on.

use crate::motion::{POSITIONS, ROOT_HEIGHT, ROOT_VELOCITY, ROOT_YAW, Yaw};
use crate::spec::TokenizerTraining;
use crate::tokenizer::corpus::Normaliser;

pub const JOINTS: usize = (POSITIONS.end - POSITIONS.start) / 3;
/// Metres that count as one.
pub const DISTANCE_M: f64 = 0.1;
/// Keeps the distance's gradient finite where it is 0, in m².
const SOFTENING_M2: f64 = 1e-6;

pub type Point = [f64; 3];

/// Length of a difference, softened so that its gradient is finite.
pub fn length(apart: &Point) -> f64 {
    (apart.iter().map(|d| d * d).sum::<f64>() + SOFTENING_M2).sqrt()
}

/// Metres a frame² up to which errors of accelerations count by their square.
const ACCELERATION_M: f64 = 0.05;

/// Errors of the joints' steps, the root's last.
type Steps = [Point; JOINTS + 1];

/// Features of one frame in metres and radians, up to the positions.
type Row = Vec<f64>;

/// Both terms with their weights.
pub struct CourseLoss {
    acceleration_weight: f64,
    root_weight: f64,
    normaliser: Normaliser,
}

impl CourseLoss {
    /// The terms of a training; `None` if neither has a weight.
    pub fn new(normaliser: &Normaliser, training: &TokenizerTraining) -> Option<Self> {
        let TokenizerTraining { acceleration_weight, root_weight, .. } = *training;
        let own = Self { acceleration_weight, root_weight, normaliser: normaliser.clone() };
        (acceleration_weight > 0.0 || root_weight > 0.0).then_some(own)
    }

    /// The terms of the first `n` frames of a window of normalised values, predicted and true; adds `share`
    /// times their gradient by the predicted values.
    pub fn of(&self, both: [&[f32]; 2], n: usize, share: f64, gradient: &mut [f32]) -> f64 {
        let [made, truth] = both.map(|values| self.rows(values, n));
        let mut slopes = vec![vec![0.0; POSITIONS.end]; n];
        let mut sum = 0.0;
        if self.acceleration_weight > 0.0 {
            sum += self.accelerations(&made, &truth, &mut slopes);
        }
        if self.root_weight > 0.0 {
            sum += self.places(&made, &truth, &mut slopes);
        }
        let width = self.normaliser.n_features();
        for (gradient, slopes) in gradient.chunks_exact_mut(width).zip(&slopes) {
            for ((gradient, slope), std) in
                gradient.iter_mut().zip(slopes).zip(&self.normaliser.std)
            {
                *gradient += (slope * share * f64::from(*std)) as f32;
            }
        }
        sum
    }

    fn rows(&self, values: &[f32], n: usize) -> Vec<Row> {
        let Normaliser { mean, std, .. } = &self.normaliser;
        let row = |frame: &[f32]| {
            let columns = frame[..POSITIONS.end].iter().zip(std).zip(mean);
            columns
                .map(|((x, std), mean)| f64::from(*x) * f64::from(*std) + f64::from(*mean))
                .collect()
        };
        values.chunks_exact(self.normaliser.n_features()).take(n).map(row).collect()
    }

    fn accelerations(&self, made: &[Row], truth: &[Row], slopes: &mut [Row]) -> f64 {
        let weight = self.acceleration_weight / (JOINTS + 1) as f64;
        let apart = made.iter().zip(truth).map(|(made, truth)| difference(made, truth));
        let apart: Vec<Row> = apart.collect();
        let seen = apart.windows(2).zip(truth);
        let steps: Vec<Steps> = seen.map(|(pair, truth)| self.steps(pair, truth)).collect();
        let mut by_step = vec![[[0.0; 3]; JOINTS + 1]; steps.len()];
        let mut sum = 0.0;
        for t in 1..steps.len() {
            for joint in 0..=JOINTS {
                let a: Point = std::array::from_fn(|i| steps[t][joint][i] - steps[t - 1][joint][i]);
                let squares = a.iter().map(|a| a * a).sum::<f64>();
                let size = (1.0 + squares / ACCELERATION_M.powi(2)).sqrt();
                sum += weight * (size - 1.0);
                for i in 0..3 {
                    let slope = weight * a[i] / (ACCELERATION_M.powi(2) * size);
                    by_step[t][joint][i] += slope;
                    by_step[t - 1][joint][i] -= slope;
                }
            }
        }
        for (t, by_step) in by_step.iter().enumerate() {
            let [before, after] = slopes[t..].first_chunk_mut().expect("a step joins two frames");
            self.spread(by_step, &truth[t], before, after);
        }
        sum
    }

    /// Errors of the steps from one frame of differences to the next, as seen from the true body.
    fn steps(&self, apart: &[Row], truth: &Row) -> Steps {
        let (now, next) = (&apart[0], &apart[1]);
        let rise =
            if self.normaliser.relative { next[ROOT_HEIGHT] - now[ROOT_HEIGHT] } else { 0.0 };
        let turn = 2.0 * now[ROOT_YAW];
        let [x, z] = [now[ROOT_VELOCITY.start], now[ROOT_VELOCITY.start + 1]];
        std::array::from_fn(|joint| {
            if joint == JOINTS {
                return [x, next[ROOT_HEIGHT] - now[ROOT_HEIGHT], z];
            }
            let at = POSITIONS.start + 3 * joint;
            let own: Point = std::array::from_fn(|i| next[at + i] - now[at + i]);
            let (p_x, p_z) = (truth[at], truth[at + 2]);
            [own[0] + x - turn * p_z, own[1] + rise, own[2] + z + turn * p_x]
        })
    }

    /// Slopes by steps into those by features of the two frames: the transpose of [`CourseLoss::steps`].
    fn spread(&self, by_step: &Steps, truth: &Row, now: &mut Row, next: &mut Row) {
        for (joint, slope) in by_step.iter().enumerate() {
            now[ROOT_VELOCITY.start] += slope[0];
            now[ROOT_VELOCITY.start + 1] += slope[2];
            let is_root = joint == JOINTS;
            if is_root || self.normaliser.relative {
                now[ROOT_HEIGHT] -= slope[1];
                next[ROOT_HEIGHT] += slope[1];
            }
            if is_root {
                continue;
            }
            let at = POSITIONS.start + 3 * joint;
            now[ROOT_YAW] += 2.0 * (slope[2] * truth[at] - slope[0] * truth[at + 2]);
            for i in 0..3 {
                now[at + i] -= slope[i];
                next[at + i] += slope[i];
            }
        }
    }

    fn places(&self, made: &[Row], truth: &[Row], slopes: &mut [Row]) -> f64 {
        let weight = self.root_weight / DISTANCE_M;
        let (own, wanted) = (places(made), places(truth));
        let mut sum = 0.0;
        // Slopes by the place of a frame.
        let by_place = own.iter().zip(&wanted).map(|(own, wanted)| {
            let off = [own.x - wanted.x, 0.0, own.z - wanted.z];
            let distance = length(&off);
            sum += weight * distance;
            [weight * off[0] / distance, weight * off[2] / distance]
        });
        let by_place: Vec<[f64; 2]> = by_place.collect();
        // A step moves all places after it, a turn the directions of its own step and of all after it.
        let (mut later, mut by_heading) = ([0.0; 2], 0.0);
        for t in (0..made.len().saturating_sub(1)).rev() {
            (0..2).for_each(|i| later[i] += by_place[t + 1][i]);
            let [x, z] = [own[t + 1].x - own[t].x, own[t + 1].z - own[t].z];
            let heading = own[t + 1].heading;
            let (by_x, by_z) = heading.rotate_xz(later[0], later[1]);
            slopes[t][ROOT_VELOCITY.start] += by_x;
            slopes[t][ROOT_VELOCITY.start + 1] += by_z;
            // Turned back by twice the half turn more, (x, z) moves along (−z, x).
            by_heading += 2.0 * (later[1] * x - later[0] * z);
            slopes[t][ROOT_YAW] += by_heading;
        }
        sum
    }
}

fn difference(a: &Row, b: &Row) -> Row {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Where the root stands and faces.
struct Place {
    x: f64,
    z: f64,
    heading: Yaw,
}

/// The root's place in each frame, as `motion::recover_joints` has it.
fn places(rows: &[Row]) -> Vec<Place> {
    let (mut x, mut z, mut half_angle) = (0.0, 0.0, 0.0);
    let place = |row: &Row| {
        let found = Place { x, z, heading: Yaw::from_half_angle(half_angle) };
        half_angle += row[ROOT_YAW];
        let back = Yaw::from_half_angle(half_angle).inverse();
        let step = &row[ROOT_VELOCITY];
        let (along_x, along_z) = back.rotate_xz(step[0], step[1]);
        (x, z) = (x + along_x, z + along_z);
        found
    };
    rows.iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::{FRAMES, normaliser, values};
    use super::*;
    use crate::motion::{N_FEATURES, recover_joints};

    fn course(acceleration_weight: f64, root_weight: f64) -> CourseLoss {
        let of =
            TokenizerTraining { acceleration_weight, root_weight, ..TokenizerTraining::default() };
        CourseLoss::new(&normaliser(), &of).expect("a term has a weight")
    }

    fn value(loss: &CourseLoss, made: &[f32], truth: &[f32], n: usize) -> f64 {
        loss.of([made, truth], n, 1.0, &mut vec![0.0; made.len()])
    }

    #[test]
    fn the_gradients_are_those_of_differences() {
        let size = FRAMES * N_FEATURES;
        let (made, truth) = (&values(1.3)[..size], &values(0.0)[..size]);
        for (loss, n) in [(course(1.0, 0.0), FRAMES), (course(0.0, 1.0), FRAMES - 1)] {
            let mut gradient = vec![0.0; size];
            loss.of([made, truth], n, 1.0, &mut gradient);
            let columns = [ROOT_YAW, 1, 2, 3, 4, 5, 6, 30, 66, 70];
            for (frame, column) in (0..FRAMES).flat_map(|t| columns.map(|c| (t, c))) {
                let at = frame * N_FEATURES + column;
                let shifted = |by: f32| {
                    let mut made = made.to_vec();
                    made[at] += by;
                    value(&loss, &made, truth, n)
                };
                let slope = (shifted(1e-3) - shifted(-1e-3)) / 2e-3;
                let found = f64::from(gradient[at]);
                let off = (slope - found).abs();
                assert!(off < 2e-4 + 0.01 * slope.abs(), "{frame} {column}: {slope} {found}");
            }
        }
    }

    #[test]
    fn what_is_right_costs_nothing_and_hidden_frames_do_not_count() {
        let truth = values(0.0)[..FRAMES * N_FEATURES].to_vec();
        let mut made = truth.clone();
        made[(FRAMES - 1) * N_FEATURES..].fill(3.0);
        assert!(value(&course(1.0, 0.0), &made, &truth, FRAMES - 1) < 1e-9);
        // A distance of 0 counts as 1 mm in each frame.
        let places = value(&course(0.0, 1.0), &made, &truth, FRAMES - 1);
        assert!((places - 0.01 * (FRAMES - 1) as f64).abs() < 1e-6, "{places}");
    }

    #[test]
    fn a_jump_costs_more_than_the_same_way_in_even_steps() {
        let loss = course(1.0, 0.0);
        let truth = vec![0.0; FRAMES * N_FEATURES];
        let moved = |by: [f32; FRAMES]| {
            let mut made = truth.clone();
            (0..FRAMES).for_each(|t| made[t * N_FEATURES + POSITIONS.start + 9] = by[t]);
            value(&loss, &made, &truth, FRAMES)
        };
        assert!(moved([0.0, 0.0, 1.0, 1.0, 1.0]) > 3.0 * moved([0.0, 0.25, 0.5, 0.75, 1.0]));
        assert!(moved([0.0, 0.25, 0.5, 0.75, 1.0]) < 1e-9);
    }

    #[test]
    fn places_are_those_of_the_recovered_root() {
        let loss = course(0.0, 1.0);
        let rows = loss.rows(&values(0.4)[..FRAMES * N_FEATURES], FRAMES);
        let wide = |row: &Row| {
            let mut row: Vec<f32> = row.iter().map(|x| *x as f32).collect();
            row.resize(N_FEATURES, 0.0);
            row
        };
        let joints = recover_joints(&rows.iter().flat_map(wide).collect::<Vec<f32>>());
        for (place, pose) in places(&rows).iter().zip(&joints) {
            let off = (place.x - f64::from(pose[0][0])).hypot(place.z - f64::from(pose[0][2]));
            assert!(off < 1e-5, "{off}");
        }
    }
}
