//! A script into joints: path, footsteps, postures, noise.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::FPS;
use super::body::pose;
use super::path::Path;
use super::plan::plan;
use super::script::Script;
use super::wander::Wander;
use crate::motion::Pose;

impl Script {
    /// The joints, `n_frames + 1` poses at [`FPS`] frames per second, metres; the script's own noise
    /// seed decides all.
    pub fn poses(&self) -> Vec<Pose> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.noise);
        let path = Path::lay(self, &mut rng);
        let mut feet = plan(self, &path, &mut rng);
        let mut wander = Wander::new(&self.manner, &mut rng);
        let frame_pose = |frame: usize| {
            let t = frame as f32 / FPS;
            let posture = wander.disturb(self.posture(t), &mut rng);
            pose(path.at(t), &posture, &[feet[0].at(t), feet[1].at(t)])
        };
        (0..=self.n_frames()).map(frame_pose).collect()
    }
}
