//! `.npy` files of joints' places as poses of HumanML3D's skeleton.

use rayon::prelude::*;

use super::error::ImportError;
use super::listing::{Listing, SourceFile};
use super::motions::{Motion, Motions};
use super::options::{Form, ImportOptions};
use crate::data::FPS;
use crate::data::npy::{NpyProblem, parse_npy};
use crate::motion::N_JOINTS;
use crate::motion::retarget::{Pose64, reflected, settled};

/// Reads every file.
///
/// # Errors
/// [`ImportError::Fps`].
pub fn read(listing: &Listing, options: &ImportOptions) -> Result<Motions, ImportError> {
    let fps = options.fps.or(listing.humanml3d.then_some(FPS)).ok_or(ImportError::Fps)?;
    let one = |file: &SourceFile| motion(file, fps, options);
    let motions = listing.files.par_iter().map(one).collect();
    Ok(Motions { motions, skeletons: Vec::new(), draft: None })
}

fn motion(file: &SourceFile, fps: f64, options: &ImportOptions) -> Result<Motion, String> {
    let bytes = std::fs::read(&file.path).map_err(|error| format!("cannot be read: {error}"))?;
    let poses = poses(&bytes, options.form).map_err(|problem| problem.to_string())?;
    let hand = |pose: Pose64| if options.left_handed { pose.map(reflected) } else { pose };
    let poses: Vec<Pose64> = poses.into_iter().map(hand).collect();
    let settled = settled(&poses, options.up).map_err(|error| error.to_string())?;
    Ok(Motion { poses: options.rate.of(&settled.poses, fps), fps, unit_m: settled.unit_m })
}

fn poses(bytes: &[u8], form: Form) -> Result<Vec<Pose64>, NpyProblem> {
    let array = parse_npy(bytes)?;
    let n_joints = match (form, &array.shape[..]) {
        (Form::SmplxJoints, &[t, n, 3]) if t > 1 && n >= N_JOINTS => n,
        (Form::Joints, &[t, N_JOINTS, 3]) if t > 1 => N_JOINTS,
        _ => {
            let expected = match form {
                Form::SmplxJoints => "[frames, 22 or more, 3], two frames or more,",
                _ => "[frames, 22, 3], two frames or more,",
            };
            return Err(NpyProblem::Shape { found: array.shape, expected });
        }
    };
    let place =
        |frame: &[f32], joint: usize| std::array::from_fn(|i| f64::from(frame[3 * joint + i]));
    let pose = |frame: &[f32]| std::array::from_fn(|joint| place(frame, joint));
    Ok(array.values.chunks_exact(3 * n_joints).map(pose).collect())
}
