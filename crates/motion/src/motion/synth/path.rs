//! The way of the root over the floor: what the actions drive, smoothed and integrated.

use super::FPS;
use super::drive::Drive;
use super::floor::FloorPose;
use super::random::Draw;
use super::script::Script;

/// Half-width in frames of each of the two running means that turn jumps of speed into ramps.
const HALF_WIDTH: usize = 4;

/// The root's place at every frame from `origin` on.
pub struct Path {
    origin: f32,
    places: Vec<FloorPose>,
}

impl Path {
    /// Lays the path of a script, with the unsteadiness of its mover.
    pub fn lay(script: &Script, rng: &mut impl Draw) -> Self {
        let origin = script.begins() - 0.5;
        let n = ((script.seconds() + 1.5 - origin) * FPS).ceil() as usize;
        let drives: Vec<Drive> =
            (0..n).map(|frame| script.drive(origin + frame as f32 / FPS)).collect();
        let mut drives = running_mean(&running_mean(&drives));
        unsettle(&mut drives, script.manner.traits.wander, rng);
        Self { origin, places: integrate(&drives) }
    }

    /// The root's place at `t`, between frames on a straight line.
    pub fn at(&self, t: f32) -> FloorPose {
        let position = ((t - self.origin) * FPS).clamp(0.0, (self.places.len() - 1) as f32);
        let frame = (position as usize).min(self.places.len() - 2);
        self.places[frame].mix(self.places[frame + 1], position - frame as f32)
    }
}

fn running_mean(drives: &[Drive]) -> Vec<Drive> {
    let last = drives.len() - 1;
    let share = 1.0 / (2 * HALF_WIDTH + 1) as f32;
    let mean = |frame: usize| {
        let window = &drives[frame.saturating_sub(HALF_WIDTH)..=(frame + HALF_WIDTH).min(last)];
        let sum = window.iter().fold(Drive::default(), |sum, d| Drive {
            left: sum.left + d.left,
            forward: sum.forward + d.forward,
            yaw: sum.yaw + d.yaw,
        });
        Drive { left: sum.left * share, forward: sum.forward * share, yaw: sum.yaw * share }
    };
    (0..drives.len()).map(mean).collect()
}

/// Slow noise on speed and heading of a moving body, none on a standing one.
fn unsettle(drives: &mut [Drive], wander: f32, rng: &mut impl Draw) {
    let (mut speed, mut heading) = (0.0, 0.0);
    for drive in drives {
        speed = 0.9 * speed + 0.436 * rng.white();
        heading = 0.94 * heading + 0.341 * rng.white();
        let moving = (drive.forward.abs() + drive.left.abs()).min(1.5);
        let factor = 1.0 + 0.03 * wander * speed;
        drive.forward *= factor;
        drive.left *= factor;
        drive.yaw += 0.05 * wander * heading * moving;
    }
}

fn integrate(drives: &[Drive]) -> Vec<FloorPose> {
    let mut place = FloorPose::default();
    let mut places = vec![place];
    places.extend(drives.iter().map(|drive| {
        let halfway = place.turned(0.5 * drive.yaw / FPS);
        let moved = halfway.offset(drive.left / FPS, drive.forward / FPS);
        place = FloorPose { yaw: place.yaw + drive.yaw / FPS, ..moved };
        place
    }));
    places
}
