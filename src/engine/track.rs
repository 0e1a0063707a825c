//! [`Track`]: which tracker follows training, as `--track` names it.

use serde::{Deserialize, Serialize};

/// A tracker of experiments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Track {
    Tensorboard,
    Wandb,
    Mlflow,
}

impl Track {
    /// Each with a line for the help.
    pub const ALL: [(Self, &'static str); 3] = [
        (Self::Tensorboard, "Event files in results/NAME/tensorboard, whatever trains"),
        (Self::Wandb, "Weights & Biases; by `trainer: torch`"),
        (Self::Mlflow, "MLflow; by `trainer: torch`"),
    ];

    /// The name on the command line and for trainers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tensorboard => "tensorboard",
            Self::Wandb => "wandb",
            Self::Mlflow => "mlflow",
        }
    }

    /// The variables by which a trainer knows that it is to track its run; empty if isoflop itself does.
    pub fn variables(self, project: String) -> Vec<(&'static str, String)> {
        match self {
            Self::Tensorboard => Vec::new(),
            Self::Wandb | Self::Mlflow => {
                vec![("ISOFLOP_TRACK", self.name().to_string()), ("ISOFLOP_TRACK_PROJECT", project)]
            }
        }
    }
}
