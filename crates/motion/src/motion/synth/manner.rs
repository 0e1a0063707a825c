//! Who moves: a style, its strength, and a person's own habits, the same for a whole clip.

use super::floor::Side;
use super::random::Draw;
use super::style::{BETWEEN_PEOPLE, PLAIN, STYLES, Style, Traits};

/// Everything about the mover that lasts for the clip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    pub style: &'static Style,
    /// How strongly the style shows: below 0.75 slight, above 1.1 strong.
    pub strength: f32,
    pub traits: Traits,
    /// The hand and foot that acts by preference.
    pub dominant: Side,
    /// The leg that a limp favours.
    pub bad_leg: Side,
    /// Breaths per second.
    pub breath_rate: f32,
}

impl Manner {
    /// Draws a style and a person.
    pub fn sample(rng: &mut impl Draw) -> Self {
        let style = rng.weighted(STYLES);
        let strength = rng.uniform(0.5, 1.3);
        let own = BETWEEN_PEOPLE.zip(Traits::from_fn(|| rng.around(0.0, 1.0)), |sd, z| sd * z);
        let traits = PLAIN.mix(style.traits, strength).zip(own, |a, b| a + b);
        Self {
            style,
            strength,
            traits: bounded(traits),
            dominant: if rng.chance(0.88) { Side::Right } else { Side::Left },
            bad_leg: rng.one_of(&Side::BOTH),
            breath_rate: rng.uniform(0.2, 0.35),
        }
    }

    /// Draws a side for an action, mostly the dominant one.
    pub fn preferred(&self, rng: &mut impl Draw) -> Side {
        if rng.chance(0.8) { self.dominant } else { self.dominant.other() }
    }
}

/// Traits that are sizes stay positive, and no body stands lower than its legs bend well.
fn bounded(traits: Traits) -> Traits {
    Traits {
        arm_swing: traits.arm_swing.max(0.0),
        elbow: traits.elbow.max(0.05),
        abduct: traits.abduct.max(0.02),
        crouch: traits.crouch.clamp(0.0, 0.18),
        twist: traits.twist.max(0.0),
        sway: traits.sway.max(0.0),
        bounce: traits.bounce.max(0.0),
        lift: traits.lift.max(0.3),
        wander: traits.wander.max(0.05),
        tremor: traits.tremor.max(0.05),
        ..traits
    }
}
