//! The state of a foot: planted, rolling off its toe, or swinging.

use super::maths::{Blend, FloorPose, Side, V3, arch, smooth};

/// Heights of the ankle and of the ball of the foot on a flat foot, metres.
pub const ANKLE: f32 = 0.075;
const BALL: f32 = 0.018;

/// A foot in one frame.
#[derive(Clone, Copy, Debug)]
pub struct Foot {
    pub ankle: V3,
    pub yaw: f32,
    /// Angle of ankle to ball below the horizontal.
    pub pitch: f32,
    /// 0 on the floor, up to 1 in the middle of a swing.
    pub airborne: f32,
}

impl Foot {
    /// From the ankle to the ball of the foot.
    pub fn toe_offset(&self, length: f32) -> V3 {
        let ((s, c), (down, along)) = (self.yaw.sin_cos(), self.pitch.sin_cos());
        [length * along * s, -length * down, length * along * c]
    }
}

/// How a foot travels between two places.
#[derive(Clone, Copy, Debug)]
pub enum Flight {
    /// Lifted by `clearance` metres, early in the swing.
    Step { clearance: f32 },
    /// With the body in a jump of `height` metres.
    Leap { height: f32 },
    /// Through points given as metres to the left, up and ahead of `root`, with the foot's pitch.
    Kick { root: FloorPose, keys: [Key; 5] },
}

/// A point of a kick: share of its time, position in the root's frame, pitch of the foot.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    pub at: f32,
    pub position: V3,
    pub pitch: f32,
}

/// One excursion of a foot from the floor.
#[derive(Clone, Copy, Debug)]
pub struct Swing {
    pub lift: f32,
    pub land: f32,
    pub from: FloorPose,
    pub to: FloorPose,
    pub flight: Flight,
    /// Height of the heel over the toe at the lift.
    pub roll_off: f32,
    /// Height of the toe at the landing.
    pub strike: f32,
}

/// All swings of one foot, and a cursor: times are asked for in rising order.
pub struct FootTrack {
    length: f32,
    start: FloorPose,
    swings: Vec<Swing>,
    done: usize,
}

impl FootTrack {
    /// A foot that stands at `start`; `length` is the bone from ankle to ball.
    pub fn new(start: FloorPose, length: f32) -> Self {
        Self { length, start, swings: Vec::with_capacity(16), done: 0 }
    }

    /// The foot's place after its last swing.
    pub fn last_place(&self) -> FloorPose {
        self.swings.last().map_or(self.start, |swing| swing.to)
    }

    /// Adds a swing; one that would begin before the last one's landing begins there.
    pub fn push(&mut self, mut swing: Swing) {
        if let Some(last) = self.swings.last() {
            swing.lift = swing.lift.max(last.land + 0.02);
            swing.land = swing.land.max(swing.lift + 0.15);
        }
        self.swings.push(swing);
    }

    /// The foot at time `t`.
    pub fn at(&mut self, t: f32) -> Foot {
        while self.swings.get(self.done).is_some_and(|swing| swing.land <= t) {
            self.done += 1;
        }
        match self.swings.get(self.done) {
            Some(swing) if swing.lift <= t => self.flying(swing, t),
            next => self.planted(next, t),
        }
    }

    /// Pitch of a flat foot.
    pub fn flat(&self) -> f32 {
        ((ANKLE - BALL) / self.length).asin()
    }

    /// On the floor: the toe comes down after a landing, the heel rises before a lift.
    fn planted(&self, next: Option<&Swing>, t: f32) -> Foot {
        let last = self.done.checked_sub(1).map(|i| &self.swings[i]);
        let place = last.map_or(self.start, |swing| swing.to);
        let landed = last.map_or(f32::NEG_INFINITY, |swing| swing.land);
        let toe_up = last.map_or(0.0, |s| s.strike * (1.0 - smooth((t - landed) / 0.14)));
        let heel_up = next.map_or(0.0, |swing| {
            let window = (0.45 * (swing.lift - landed)).min(0.32);
            let u = ((t - swing.lift) / window + 1.0).max(0.0);
            swing.roll_off * u * u
        });
        self.over_toe(place, heel_up, toe_up)
    }

    /// Heel raised about the ball, or toe raised about the ankle.
    fn over_toe(&self, place: FloorPose, heel_up: f32, toe_up: f32) -> Foot {
        let (flat, pitch) = (self.flat(), self.flat() + heel_up);
        let forward = self.length * (flat.cos() - pitch.cos());
        let at = place.offset(0.0, forward);
        let height = ANKLE + self.length * (pitch.sin() - flat.sin());
        let ankle = [at.x, height, at.z];
        Foot { ankle, yaw: place.yaw, pitch: pitch - toe_up, airborne: 0.0 }
    }

    fn flying(&self, swing: &Swing, t: f32) -> Foot {
        let u = (t - swing.lift) / (swing.land - swing.lift);
        let mut foot = match &swing.flight {
            Flight::Step { clearance } => self.stepping(swing, *clearance, u),
            Flight::Leap { height } => self.leaping(swing, *height, u),
            Flight::Kick { root, keys } => kicking(swing, *root, keys, u),
        };
        // The ball of the foot stays above the floor whatever the pitch.
        foot.ankle[1] = foot.ankle[1].max(0.6 * BALL + self.length * foot.pitch.sin());
        foot
    }

    fn stepping(&self, swing: &Swing, clearance: f32, u: f32) -> Foot {
        let off = self.over_toe(swing.from, swing.roll_off, 0.0);
        let (s, v) = (smooth(u), 1.0 - u);
        let mix = |a: f32, b: f32| a + (b - a) * s;
        let lifted = mix(off.ankle[1], ANKLE) + clearance * 6.75 * u * v * v;
        Foot {
            ankle: [mix(off.ankle[0], swing.to.x), lifted, mix(off.ankle[2], swing.to.z)],
            yaw: mix(swing.from.yaw, swing.to.yaw),
            pitch: mix(off.pitch, self.flat() - swing.strike) + 0.6 * swing.roll_off * u * v * v,
            airborne: arch(u),
        }
    }

    fn leaping(&self, swing: &Swing, height: f32, u: f32) -> Foot {
        let off = self.over_toe(swing.from, swing.roll_off, 0.0);
        let place = FloorPose { x: off.ankle[0], z: off.ankle[2], ..swing.from }.mix(swing.to, u);
        let rest = off.ankle[1] + (ANKLE - off.ankle[1]) * smooth(1.6 * u);
        Foot {
            ankle: [place.x, rest + (height + 0.02) * arch(u), place.z],
            yaw: place.yaw,
            pitch: off.pitch + (self.flat() - off.pitch) * smooth(u) + 0.3 * arch(u),
            airborne: arch(u),
        }
    }
}

fn kicking(swing: &Swing, root: FloorPose, keys: &[Key; 5], u: f32) -> Foot {
    let (position, pitch) = through(keys, u);
    let at = root.offset(position[0], position[2]);
    let facing = swing.from.mix(swing.to, smooth(u)).yaw;
    // Off the floor the foot turns to the body's facing.
    let yaw = facing + (root.yaw - facing) * arch(u);
    Foot { ankle: [at.x, position[1], at.z], yaw, pitch, airborne: arch(u) }
}

/// The cubic Hermite curve through the keys that rests at both ends.
fn through(keys: &[Key; 5], u: f32) -> (V3, f32) {
    let i = keys[1..4].iter().take_while(|key| key.at <= u).count();
    let (a, b) = (&keys[i], &keys[i + 1]);
    let (span, s) = (b.at - a.at, (u - a.at) / (b.at - a.at));
    let channel = |value: &dyn Fn(&Key) -> f32| {
        let slope = |j: usize| {
            if j == 0 || j == 4 {
                return 0.0;
            }
            (value(&keys[j + 1]) - value(&keys[j - 1])) / (keys[j + 1].at - keys[j - 1].at)
        };
        let (s2, s3) = (s * s, s * s * s);
        (2.0 * s3 - 3.0 * s2 + 1.0) * value(a)
            + (s3 - 2.0 * s2 + s) * span * slope(i)
            + (3.0 * s2 - 2.0 * s3) * value(b)
            + (s3 - s2) * span * slope(i + 1)
    };
    ([0, 1, 2].map(|axis| channel(&|key| key.position[axis])), channel(&|key| key.pitch))
}

/// The resting place of a foot: `width` to the side of the root, turned out.
pub fn rest(root: FloorPose, side: Side, width: f32, toe_out: f32) -> FloorPose {
    root.offset(side.sign() * width, -0.01).turned(side.sign() * toe_out)
}
