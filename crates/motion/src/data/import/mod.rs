//! Motion of other layouts and skeletons as a folder in the HumanML3D layout.
//!
//! ```text
//! listing → motion (BVH or joints, retargeted) → cut ─┐
//!              captions, groups → splits ──────────────┴→ folder
//! ```
//!
//! Every file is read on its own, so that all that is wrong is told at once, a sentence each. The folder
//! appears whole, by rename, and the same files give the same bytes.

mod bvh;
mod captions;
mod clips;
mod cut;
mod error;
mod folder;
mod group;
mod joints;
mod kit;
mod listing;
mod manifest;
mod motions;
mod options;
mod rate;
mod synthetic;
#[cfg(test)]
mod tests;

pub use cut::SHORTEST;
pub use error::ImportError;
pub use folder::{Imported, SplitCount};
pub use motions::Skeleton;
pub use options::{Form, GroupBy, ImportOptions, read_map};
pub use rate::Rate;
pub use synthetic::write_procedural;

use std::path::Path;

use clips::Clips;

/// Reads the motion in `options.from` and writes the data set `to`, whole.
///
/// # Errors
/// [`ImportError`]: there is no such file, nothing can be used, the folder is there already or cannot be
/// written. Files that cannot be used while others can are [`Imported::problems`].
pub fn import(options: &ImportOptions, to: &Path) -> Result<Imported, ImportError> {
    folder::check_place(to, options.overwrite)?;
    let listing = listing::list(&options.from, options.form)?;
    let motions = match options.form {
        Form::Bvh => bvh::read(&listing.files, options),
        Form::Joints | Form::SmplxJoints | Form::Kit => joints::read(&listing, options)?,
    };
    let clips = Clips::of(motions, &listing, options)?;
    folder::write(clips, to)
}
