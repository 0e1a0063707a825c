//! How a folder holds its motion: as features, or as joints from which features follow.

use std::path::Path;

use super::npy::{NpyArray, NpyProblem};
use crate::motion::{N_FEATURES, N_JOINTS, Pose, build_features};

/// What the motion files of a folder hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MotionFiles {
    pub folder: &'static str,
    /// The shape of each, in words.
    shape: &'static str,
    /// What the digest of a data set says of them; changes when features follow in another way.
    pub rule: &'static str,
}

impl MotionFiles {
    /// `[T, 263]`.
    pub(super) const FEATURES: Self =
        Self { folder: "new_joint_vecs", shape: "[frames, 263]", rule: "" };
    /// The same, as Motion-X has it.
    pub(super) const MOTION_X: Self = Self { folder: "vector_263", ..Self::FEATURES };
    /// `[T + 1, 22, 3]`, metres, y up.
    pub(super) const JOINTS: Self = Self {
        folder: "new_joints",
        shape: "[frames, 22, 3], two frames or more,",
        rule: " joints-1",
    };

    /// Those of the folder `root`; features where it has both.
    pub(super) fn of(root: &Path) -> Option<Self> {
        [Self::FEATURES, Self::MOTION_X, Self::JOINTS]
            .into_iter()
            .find(|files| root.join(files.folder).is_dir())
    }

    /// Whether clips lie in folders below, so that their names have `/` in them.
    pub(super) fn in_folders(self) -> bool {
        self == Self::MOTION_X
    }

    /// The folder of captions in the folder `root`.
    pub(super) fn texts(self, root: &Path) -> &'static str {
        const LABELS: &str = "texts/semantic_labels";
        let has_labels = self == Self::MOTION_X && root.join(LABELS).is_dir();
        if has_labels { LABELS } else { "texts" }
    }

    /// Name within the data set of the motion of clip `id`.
    pub(super) fn name(self, id: &str) -> String {
        format!("{}/{id}.npy", self.folder)
    }

    /// Features `[T, 263]`, row-major, T ≥ 1.
    ///
    /// # Errors
    /// The array has another shape.
    pub(super) fn features(self, array: NpyArray) -> Result<Vec<f32>, NpyProblem> {
        match (self, &array.shape[..]) {
            (Self::FEATURES | Self::MOTION_X, &[t, N_FEATURES]) if t > 0 => Ok(array.values),
            (Self::JOINTS, &[t, N_JOINTS, 3]) if t > 1 => Ok(build_features(&poses(&array.values))),
            _ => Err(NpyProblem::Shape { found: array.shape, expected: self.shape }),
        }
    }
}

fn poses(values: &[f32]) -> Vec<Pose> {
    let pose = |frame: &[f32]| std::array::from_fn(|j| std::array::from_fn(|i| frame[3 * j + i]));
    values.chunks_exact(N_JOINTS * 3).map(pose).collect()
}
