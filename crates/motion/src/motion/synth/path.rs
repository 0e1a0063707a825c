//! The root's path over the floor, and the time and place of each footstep.

use super::action::{Act, Action};
use super::airborne::{Jump, Kick};
use super::feet::{Flight, FootTrack, Swing, rest};
use super::manner::Manner;
use super::maths::{Blend, Draw, Drive, FPS, FloorPose, Side};
use super::script::Script;
use super::travel::{Gait, Travel};
use crate::motion::BONE_LENGTHS;

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
        let sum = window.iter().fold(Drive::default(), |sum, next| sum.zip(*next, |a, b| a + b));
        sum.zip(sum, |a, _| a * share)
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

// Footsteps.

/// Lays the swings of both feet along a path.
pub fn footsteps(script: &Script, path: &Path, rng: &mut impl Draw) -> [FootTrack; 2] {
    let traits = &script.manner.traits;
    let begin = path.at(script.begins() - 0.5);
    let feet = Side::BOTH.map(|side| {
        let place = rest(begin, side, traits.width, traits.toe_out);
        FootTrack::new(place, BONE_LENGTHS[10 + side.index()])
    });
    let mut planner = Planner { path, manner: &script.manner, feet, rng };
    for act in &script.acts {
        match &act.action {
            Action::Travel(travel) => planner.walk(act, travel, script.seconds()),
            Action::Jump(jump) => planner.jump(act, jump),
            Action::Kick(kick) => planner.kick(act, kick),
            _ => {}
        }
    }
    planner.feet
}

struct Planner<'a, R> {
    path: &'a Path,
    manner: &'a Manner,
    feet: [FootTrack; 2],
    rng: &'a mut R,
}

impl<R: Draw> Planner<'_, R> {
    /// Each foot in turn, from the steps before the clip to the step that closes the feet.
    fn walk(&mut self, act: &Act, travel: &Travel, seconds: f32) {
        let first = -(act.early / travel.step_time).round() as i32;
        let after = if act.late > 0.0 {
            ((seconds + 0.5 - act.start) / travel.step_time).ceil() as i32
        } else {
            travel.steps as i32 + i32::from(!act.joins_next)
        };
        for i in first..after {
            let lift = act.start + i as f32 * travel.step_time;
            self.step(travel, travel.foot(i), lift);
        }
    }

    /// A step lands where the root will be in the middle of the stance that follows, or, going
    /// forward, before it: the heel's rise lets the foot trail further than it can reach ahead.
    fn step(&mut self, travel: &Travel, side: Side, lift: f32) {
        let (time, duty, traits) = (travel.step_time, travel.duty(), &self.manner.traits);
        let land = lift + 2.0 * time * (1.0 - duty);
        let share = if travel.drive().forward > 0.0 { 0.8 } else { 1.0 };
        let middle = land + share * time * duty;
        // The good foot hurries while the bad leg carries the body.
        let limp = if side == self.manner.bad_leg { 0.0 } else { 0.2 * time * traits.limp };
        let footwork = Footwork::of(travel);
        let width = traits.width * footwork.stance;
        let swing = Swing {
            lift: lift + limp + self.rng.around(0.0, 0.012 * traits.wander.min(2.0)),
            land: land - 0.5 * limp,
            from: self.feet[side.index()].last_place(),
            to: self.unsteady(rest(self.path.at(middle), side, width, traits.toe_out)),
            flight: Flight::Step { clearance: (footwork.clearance * traits.lift).min(0.28) },
            roll_off: footwork.roll_off * traits.lift.clamp(0.6, 1.2),
            strike: footwork.strike,
        };
        self.feet[side.index()].push(swing);
    }

    /// The resting place of a foot next to the root.
    fn resting(&self, root: FloorPose, side: Side) -> FloorPose {
        let traits = &self.manner.traits;
        rest(root, side, traits.width, traits.toe_out)
    }

    /// A place that a living foot meets.
    fn unsteady(&mut self, place: FloorPose) -> FloorPose {
        let spread = 0.009 * self.manner.traits.wander;
        let (left, forward) = (self.rng.around(0.0, spread), self.rng.around(0.0, 1.3 * spread));
        place.offset(left, forward).turned(self.rng.around(0.0, 4.0 * spread))
    }

    fn jump(&mut self, act: &Act, jump: &Jump) {
        for i in 0..jump.count {
            let (lift, land) = jump.airtime(i);
            let target = self.path.at(act.start + land + 0.3);
            for side in Side::BOTH {
                let swing = Swing {
                    lift: act.start + lift + self.rng.around(0.0, 0.012),
                    land: act.start + land,
                    from: self.feet[side.index()].last_place(),
                    to: self.unsteady(self.resting(target, side)),
                    flight: Flight::Leap { height: jump.height },
                    roll_off: 0.6 + 0.5 * jump.height,
                    strike: 0.0,
                };
                self.feet[side.index()].push(swing);
            }
        }
    }

    fn kick(&mut self, act: &Act, kick: &Kick) {
        let leg = kick.leg.index();
        for i in 0..kick.repeats.count {
            let (lift, land) = kick.airtime(i);
            let root = self.path.at(act.start + lift);
            let from = self.feet[leg].last_place();
            let to = self.unsteady(self.resting(root, kick.leg));
            let flight = kick.flight(root, from, to, self.feet[leg].flat());
            let (lift, land) = (act.start + lift, act.start + land);
            self.feet[leg].push(Swing { lift, land, from, to, flight, roll_off: 0.0, strike: 0.0 });
        }
    }
}

/// How the feet of a gait leave the floor and meet it.
struct Footwork {
    /// Width of the stance against standing: narrow in a run, wide when feet must not meet.
    stance: f32,
    clearance: f32,
    roll_off: f32,
    strike: f32,
}

impl Footwork {
    fn of(travel: &Travel) -> Self {
        let speed = travel.speed();
        let flat = |stance| Self { stance, clearance: 0.05, roll_off: 0.15, strike: 0.0 };
        match travel.gait {
            Gait::Run => {
                let clearance = 0.08 + 0.07 * speed;
                Self { stance: 0.5, clearance, roll_off: 0.95, strike: 0.12 }
            }
            Gait::Walk | Gait::Arc(_) => Self {
                stance: 0.85,
                clearance: 0.03 + 0.03 * speed,
                roll_off: (0.15 + 0.45 * speed).min(0.8),
                strike: (0.3 * speed).min(0.42),
            },
            Gait::Back => flat(0.85),
            Gait::Sideways(_) => flat(1.35),
            Gait::Turn(_) => flat(1.1),
        }
    }
}
