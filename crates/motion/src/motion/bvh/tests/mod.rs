//! Poses into text and back, and other people's files.

mod fit;
mod real;
mod text;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::*;
use crate::motion::Pose;
use crate::motion::synth::Script;

/// Poses of a procedural clip.
fn procedural(seed: u64) -> Vec<Pose> {
    Script::sample(&mut ChaCha8Rng::seed_from_u64(seed)).poses()
}

/// The largest distance in millimetres between `poses` and the text of their file, read again.
fn written_and_read_mm(poses: &[Pose]) -> f64 {
    let text = fit_bvh(poses, 20.0).expect("sound poses").bvh.to_string();
    let read = Bvh::parse(&text).expect("a sound file").poses().expect("our own names");
    assert_eq!(read.len(), poses.len());
    let joints = poses.as_flattened().iter().zip(read.as_flattened());
    let squared = |(a, b): (&[f32; 3], &[f32; 3])| {
        (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>()
    };
    joints.map(squared).fold(0.0, f64::max).sqrt() * 1000.0
}

/// The largest change in degrees of a rotation channel from frame to frame, with its joint.
fn largest_step(bvh: &Bvh) -> (f64, String) {
    let names = bvh.joints.iter().flat_map(|joint| {
        joint.channels.iter().map(|channel| (format!("{} {channel:?}", joint.name), *channel))
    });
    let names: Vec<(String, Channel)> = names.collect();
    let mut largest = (0.0, String::new());
    for pair in bvh.frames.windows(2) {
        for (index, (name, channel)) in names.iter().enumerate() {
            let step = (pair[1][index] - pair[0][index]).abs();
            if matches!(channel, Channel::Rotation(_)) && step > largest.0 {
                largest = (step, name.clone());
            }
        }
    }
    largest
}
