//! How a folder holds its motion: as features, or as joints from which features follow.

use std::path::Path;

use super::npy::{NpyArray, NpyProblem};
use crate::motion::{N_FEATURES, N_JOINTS, Pose, build_features};

/// What the motion files of a folder hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MotionFiles {
    /// `new_joint_vecs`: `[T, 263]`.
    Features,
    /// `vector_263`: the same, as Motion-X has it.
    MotionX,
    /// `new_joints`: `[T + 1, 22, 3]`, metres, y up.
    Joints,
}

impl MotionFiles {
    /// Those of the folder `root`; features where it has both.
    pub(super) fn of(root: &Path) -> Option<Self> {
        [Self::Features, Self::MotionX, Self::Joints]
            .into_iter()
            .find(|files| root.join(files.folder()).is_dir())
    }

    pub(super) fn folder(self) -> &'static str {
        match self {
            Self::Features => "new_joint_vecs",
            Self::MotionX => "vector_263",
            Self::Joints => "new_joints",
        }
    }

    /// Whether clips lie in folders below, so that their names have `/` in them.
    pub(super) fn in_folders(self) -> bool {
        self == Self::MotionX
    }

    /// The folder of captions in the folder `root`.
    pub(super) fn texts(self, root: &Path) -> &'static str {
        const LABELS: &str = "texts/semantic_labels";
        let has_labels = self == Self::MotionX && root.join(LABELS).is_dir();
        if has_labels { LABELS } else { "texts" }
    }

    /// Name within the data set of the motion of clip `id`.
    pub(super) fn name(self, id: &str) -> String {
        format!("{}/{id}.npy", self.folder())
    }

    /// Features `[T, 263]`, row-major, T ≥ 1.
    ///
    /// # Errors
    /// The array has another shape.
    pub(super) fn features(self, array: NpyArray) -> Result<Vec<f32>, NpyProblem> {
        match (self, &array.shape[..]) {
            (Self::Features | Self::MotionX, &[t, N_FEATURES]) if t > 0 => Ok(array.values),
            (Self::Joints, &[t, N_JOINTS, 3]) if t > 1 => Ok(build_features(&poses(&array.values))),
            _ => Err(NpyProblem::Shape { found: array.shape, expected: self.shape() }),
        }
    }

    fn shape(self) -> &'static str {
        match self {
            Self::Features | Self::MotionX => "[frames, 263]",
            Self::Joints => "[frames, 22, 3], two frames or more,",
        }
    }

    /// What the digest of a data set says of them; changes when features follow in another way.
    pub(super) fn rule(self) -> &'static str {
        match self {
            Self::Features | Self::MotionX => "",
            Self::Joints => " joints-1",
        }
    }
}

fn poses(values: &[f32]) -> Vec<Pose> {
    let pose = |frame: &[f32]| std::array::from_fn(|j| std::array::from_fn(|i| frame[3 * j + i]));
    values.chunks_exact(N_JOINTS * 3).map(pose).collect()
}
