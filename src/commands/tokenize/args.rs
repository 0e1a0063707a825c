//! What `isoflop tokenize` takes.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::commands::args::TokenizerChoice;

#[derive(Args)]
pub struct TokenizeArgs {
    /// Motions: .npy of features, T × 263, or of joints, T × 22 × 3; or .bvh with the 22 joints
    #[arg(value_name = "FILE", required = true)]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub tokenizer: TokenizerChoice,
    /// The caption of every motion, for a tokenizer with language; by default that of a .txt beside it
    #[arg(long, value_name = "TEXT", conflicts_with = "texts")]
    pub caption: Option<String>,
    /// A file with a caption a line, in the order of the motions
    #[arg(long, value_name = "FILE")]
    pub texts: Option<PathBuf>,
    /// The folder to write to: a .json of codes for each motion
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Write over codes that the folder holds
    #[arg(long)]
    pub overwrite: bool,
}

/// The name of a motion: `walk` of `a/walk.npy`, of `walk.features.npy` and of `walk.joints.npy`.
pub fn motion_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let bare = stem.strip_suffix(".features").or(stem.strip_suffix(".joints"));
    bare.unwrap_or(&stem).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_motion_have_one_name() {
        for path in ["a/walk.npy", "walk.features.npy", "b/walk.joints.npy", "walk.bvh"] {
            assert_eq!(motion_name(Path::new(path)), "walk");
        }
    }
}
