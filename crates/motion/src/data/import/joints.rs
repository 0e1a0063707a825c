//! `.npy` files of joints' places as poses of HumanML3D's skeleton.

use rayon::prelude::*;

use super::error::ImportError;
use super::kit::{self, First};
use super::listing::{Listing, SourceFile};
use super::motions::{Motion, Motions};
use super::options::{Form, ImportOptions};
use crate::data::FPS;
use crate::data::npy::{NpyArray, NpyProblem, parse_npy};
use crate::files::{LARGE, read_regular};
use crate::motion::N_JOINTS;
use crate::motion::retarget::{PointsError, Pose64, Settled, reflected, settled};

/// Reads every file.
///
/// # Errors
/// [`ImportError::Fps`].
pub fn read(listing: &Listing, options: &ImportOptions) -> Result<Motions, ImportError> {
    let of_layout = match options.form {
        Form::Kit => Some(kit::FPS),
        _ => listing.humanml3d.then_some(FPS),
    };
    let fps = options.fps.or(of_layout).ok_or(ImportError::Fps)?;
    let one = |file: &SourceFile| motion(file, fps, options);
    let motions = listing.files.par_iter().map(one).collect();
    Ok(Motions { motions, skeletons: Vec::new(), draft: None })
}

fn motion(file: &SourceFile, fps: f64, options: &ImportOptions) -> Result<Motion, String> {
    let bytes =
        read_regular(&file.path, LARGE).map_err(|error| format!("cannot be read: {error}"))?;
    let array = parse_npy(&bytes).map_err(|problem| problem.to_string())?;
    let settle = |poses: Result<Vec<Pose64>, NpyProblem>| {
        let poses = poses.map_err(|problem| problem.to_string())?;
        let hand = |pose: Pose64| if options.left_handed { pose.map(reflected) } else { pose };
        let poses: Vec<Pose64> = poses.into_iter().map(hand).collect();
        Ok::<_, String>(settled(&poses, options.up))
    };
    let Settled { poses, unit_m, .. } = match options.form {
        Form::Kit => of_either_side(|first| settle(of_kit(&array, first)))?,
        form => settle(of_humanml3d(&array, form))?.map_err(|error| error.to_string())?,
    };
    Ok(Motion { poses: options.rate.of(&poses, fps), fps, unit_m })
}

/// KIT-ML's sides are told apart by the toes: sources do not agree on which comes first.
fn of_either_side(
    settle: impl Fn(First) -> Result<Result<Settled, PointsError>, String>,
) -> Result<Settled, String> {
    let found = match settle(First::Right)? {
        Err(PointsError::Backwards) => settle(First::Left)?,
        found => found,
    };
    found.map_err(|error| error.to_string())
}

fn of_humanml3d(array: &NpyArray, form: Form) -> Result<Vec<Pose64>, NpyProblem> {
    let n_joints = match (form, &array.shape[..]) {
        (Form::SmplxJoints, &[t, n, 3]) if t > 1 && n >= N_JOINTS => n,
        (Form::Joints, &[t, N_JOINTS, 3]) if t > 1 => N_JOINTS,
        _ => {
            let expected = match form {
                Form::SmplxJoints => "[frames, 22 or more, 3], two frames or more,",
                _ => "[frames, 22, 3], two frames or more,",
            };
            return Err(NpyProblem::Shape { found: array.shape.clone(), expected });
        }
    };
    let pose = |frame: &[f32]| std::array::from_fn(|joint| place(frame, joint));
    Ok(array.values.chunks_exact(3 * n_joints).map(pose).collect())
}

/// The joints of KIT-ML, given as they are or as the features made of them.
fn of_kit(array: &NpyArray, first: First) -> Result<Vec<Pose64>, NpyProblem> {
    let values = array.values.as_slice();
    let bodies = match array.shape[..] {
        [t, kit::JOINTS, 3] if t > 1 => {
            let body = |frame: &[f32]| std::array::from_fn(|joint| place(frame, joint));
            values.chunks_exact(3 * kit::JOINTS).map(body).collect()
        }
        [t, kit::FEATURES] if t > 1 => kit::bodies(values),
        _ => {
            let expected = "[frames, 21, 3] or [frames, 251], two frames or more,";
            return Err(NpyProblem::Shape { found: array.shape.clone(), expected });
        }
    };
    Ok(bodies.iter().map(|body| kit::pose(body, first)).collect())
}

fn place(frame: &[f32], joint: usize) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(frame[3 * joint + i]))
}
