//! A seeded generator of human motion: the built-in data set.
//!
//! Data flows one way: [`Script`] (person, manner, actions, times) → root path and footsteps → posture of each frame →
//! joints. The skeleton is HumanML3D's with 22 joints and constant bone lengths; feet are planted and legs reach them by
//! two-bone inverse kinematics; arms and trunk are angles, so nothing can stretch.
//!
//! A clip has structure at many scales, for models of many sizes: noise and breathing within a frame, gait cycles, step
//! counts and turn angles, repeated actions with the same numbers, and a manner that lasts for the whole clip and is
//! named in its captions.
//!
//! Frames: right-handed, y up, the body faces +z and its left is +x. Metres, seconds, radians.

#[macro_use]
mod maths;

mod action;
mod airborne;
mod body;
mod feet;
mod in_place;
mod manner;
mod path;
mod phrase;
mod script;
mod travel;

pub use maths::FPS;
pub use script::Script;

/// Raised whenever the same seed no longer gives the same clips; part of a data set's digest.
pub const REVISION: u32 = 1;

/// Properties of every clip of the generator, tested on a few hundred.
#[cfg(test)]
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use super::action::Action;
    use super::airborne::Aim;
    use super::maths::Side;
    use super::travel::{Gait, Travel};
    use super::*;
    use crate::motion::{
        BONE_LENGTHS, CONTACTS, N_JOINTS, PARENTS, Pose, build_features, canonicalise,
        recover_joints,
    };

    fn scripts(n: u64) -> impl Iterator<Item = Script> {
        (0..n).map(|stream| {
            let mut rng = ChaCha8Rng::seed_from_u64(20);
            rng.set_stream(stream);
            Script::sample(&mut rng)
        })
    }

    fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
        (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f32>().sqrt()
    }

    /// The steps of a script that consists of nothing else.
    fn only_travel(script: &Script) -> Option<&Travel> {
        match script.acts.as_slice() {
            [act] => act.action.travel(),
            _ => None,
        }
    }

    /// Radians to the left of +z, from the hips.
    fn heading(pose: &Pose) -> f32 {
        let across = [pose[1][0] - pose[2][0], pose[1][2] - pose[2][2]];
        (-across[1]).atan2(across[0])
    }

    #[test]
    fn bones_keep_their_lengths() {
        for pose in scripts(150).flat_map(|script| script.poses()) {
            for joint in 1..N_JOINTS {
                let parent = PARENTS[joint].expect("only the pelvis has no parent");
                let error = distance(pose[joint], pose[parent]) - BONE_LENGTHS[joint];
                assert!(error.abs() < 1e-4, "joint {joint} is off by {error} m");
            }
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        for (a, b) in scripts(40).zip(scripts(40)) {
            assert_eq!(a, b);
            assert_eq!(a.captions(), b.captions());
            let bits = |script: &Script| -> Vec<u32> {
                script.poses().iter().flatten().flatten().map(|x| x.to_bits()).collect()
            };
            assert_eq!(bits(&a), bits(&b));
        }
    }

    #[test]
    fn lengths_are_whole_tokens_from_40_to_196_frames() {
        let lengths: Vec<usize> = scripts(2000).map(|script| script.n_frames()).collect();
        assert!(lengths.iter().all(|n| n.is_multiple_of(4) && (40..=196).contains(n)));
        let mean = lengths.iter().sum::<usize>() as f32 / lengths.len() as f32;
        assert!((125.0..155.0).contains(&mean), "mean length {mean}");
        for script in scripts(50) {
            assert_eq!(script.poses().len(), script.n_frames() + 1);
        }
    }

    #[test]
    fn no_joint_teleports_and_no_foot_sinks() {
        for (clip, script) in scripts(400).enumerate() {
            let poses = script.poses();
            let lowest = poses.iter().flatten().map(|joint| joint[1]).fold(f32::INFINITY, f32::min);
            assert!(lowest > -0.02, "clip {clip} sinks to {lowest} m");
            for (frame, pair) in poses.windows(2).enumerate() {
                for (joint, (&a, &b)) in pair[0].iter().zip(&pair[1]).enumerate() {
                    let speed = distance(a, b) * FPS;
                    assert!(speed < 12.0, "clip {clip}, frame {frame}, joint {joint}: {speed} m/s");
                }
            }
        }
    }

    #[test]
    fn features_give_the_poses_back() {
        for script in scripts(60) {
            let poses = canonicalise(&script.poses());
            let recovered = recover_joints(&build_features(&poses));
            assert_eq!(recovered.len() + 1, poses.len());
            for (a, b) in recovered.iter().flatten().zip(poses.iter().flatten()) {
                assert!(distance(*a, *b) < 2e-3, "{a:?} for {b:?}");
            }
        }
    }

    #[test]
    fn a_walk_has_one_foot_in_contact_and_the_feet_take_turns() {
        let (mut frames, mut touching, mut apart) = (0, 0, 0);
        let walks = scripts(1500).filter(|s| only_travel(s).is_some_and(|t| t.gait == Gait::Walk));
        for script in walks {
            for row in build_features(&script.poses()).chunks_exact(263) {
                let contact = &row[CONTACTS];
                let (left, right) = (contact[0] * contact[1] > 0.5, contact[2] * contact[3] > 0.5);
                frames += 1;
                touching += usize::from(left || right);
                apart += usize::from(left != right);
            }
        }
        assert!(frames > 2000, "{frames} frames of walking");
        assert!(touching as f32 > 0.85 * frames as f32, "{touching} of {frames} touch the floor");
        assert!(apart as f32 > 0.35 * frames as f32, "{apart} of {frames} stand on one foot");
    }

    #[test]
    fn a_jump_rises_by_its_height() {
        let mut jumps = 0;
        for script in scripts(1500) {
            let [act] = script.acts.as_slice() else { continue };
            let Action::Jump(jump) = &act.action else { continue };
            let heights = script.poses().into_iter().map(|pose| pose[0][1]);
            let standing = script.poses()[0][0][1];
            let rise = heights.fold(0.0, f32::max) - standing;
            let excess = rise - jump.height;
            assert!((-0.03..0.1).contains(&excess), "rises {rise} m for {} m", jump.height);
            jumps += usize::from(jump.aim == Aim::Up);
        }
        assert!(jumps > 3, "only {jumps} jumps on the spot");
    }

    #[test]
    fn a_turn_turns_by_its_angle() {
        let mut turns = 0;
        for script in scripts(1500) {
            let Some(travel) = only_travel(&script) else { continue };
            if !matches!(travel.gait, Gait::Turn(_)) {
                continue;
            }
            turns += 1;
            let poses = script.poses();
            let turned = heading(&poses[poses.len() - 1]) - heading(&poses[0]);
            let error = (turned - travel.turn).sin().abs();
            assert!(error < 0.4, "turned {turned} for {}", travel.turn);
        }
        assert!(turns > 10, "only {turns} turns");
    }

    /// Ways to begin the verb of an action.
    fn verbs(action: &Action) -> &'static [&'static str] {
        match action {
            Action::Travel(travel) => match travel.gait {
                Gait::Walk | Gait::Arc(_) => &[" walk", " stroll", " paces", " pacing"],
                Gait::Run => &[" run", " jog", " sprint"],
                Gait::Back => &[" walks backward", " walking backward", " back"],
                Gait::Sideways(_) => &[" sidestep", " steps sideways", " stepping side", " shuffl"],
                Gait::Turn(_) => &[" turns", " turning", " rotat"],
            },
            Action::Jump(_) => &[" jump", " leap", " hop"],
            Action::Kick(_) => &[" kick"],
            Action::Wave(_) => &[" waves", " waving"],
            Action::Punch(_) => &[" punch", " throw"],
            Action::Clap(..) => &[" clap"],
            Action::Stretch { .. } => &[" rais", " lift", " stretch"],
            Action::Bow(..) => &[" bow"],
            Action::Squat(..) => &[" squat", " crouch"],
            Action::Sit(_) => &[" sit", " takes a seat", " taking a seat"],
            Action::Stand(..) => &[" stand", " wait", " look"],
        }
    }

    #[test]
    fn captions_tell_every_action_in_its_order() {
        let mut longest = 0;
        for script in scripts(500) {
            longest = longest.max(script.acts.len());
            for caption in script.captions() {
                let mut rest = caption.as_str();
                for act in &script.acts {
                    let found = verbs(&act.action).iter().filter_map(|verb| rest.find(verb)).min();
                    let Some(at) = found else {
                        panic!("{:?} is not told in {caption:?}", act.action)
                    };
                    rest = &rest[at + 1..];
                }
            }
        }
        assert_eq!(longest, 4);
    }

    #[test]
    fn captions_of_a_turn_tell_its_side() {
        let mut sides = [0, 0];
        for script in scripts(1500) {
            let Some(Gait::Turn(side)) = only_travel(&script).map(|travel| travel.gait) else {
                continue;
            };
            sides[side.index()] += 1;
            for caption in script.captions() {
                assert!(caption.contains(side.word()), "{caption}");
                assert!(!caption.contains(side.other().word()), "{caption}");
            }
        }
        assert!(sides[Side::Left.index()] > 3 && sides[Side::Right.index()] > 3);
    }

    #[test]
    fn every_action_occurs_and_common_ones_are_far_more_common() {
        let mut counts = std::collections::BTreeMap::new();
        for act in scripts(3000).flat_map(|script| script.acts.clone()) {
            *counts.entry(verbs(&act.action)[0]).or_insert(0) += 1;
        }
        let (rare, common) = (counts.values().min(), counts.values().max());
        assert_eq!(counts.len(), 15, "{counts:?}");
        assert!(rare.zip(common).is_some_and(|(rare, common)| *rare > 20 && *common > 15 * rare));
    }

    #[test]
    fn a_repeated_action_repeats_its_numbers() {
        let mut repeats = 0;
        for script in scripts(500) {
            for i in 2..script.acts.len() {
                if !script.acts[i].again {
                    continue;
                }
                repeats += 1;
                let (earlier, later) = (&script.acts[i - 2].action, &script.acts[i].action);
                assert_eq!(earlier.duration(), later.duration());
                assert_eq!(verbs(earlier), verbs(later));
                assert!(script.captions()[0].contains(" again"));
            }
        }
        assert!(repeats > 20, "only {repeats} repeats");
    }
}
