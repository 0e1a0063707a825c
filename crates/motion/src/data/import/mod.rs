//! Imports motion of other layouts and skeletons into a folder in the HumanML3D layout.
//!
//! ```text
//! listing → motion (BVH or joints, retargeted) → cut ─┐
//!              captions, groups → splits ──────────────┴→ folder
//! ```
//!
//! Every file is read separately, so all problems are reported at once, one sentence each. The folder is renamed into
//! place, and the same files give the same bytes.

mod bvh;
mod clips;
mod folder;
mod joints;
mod listing;
mod options;
#[cfg(test)]
mod tests;

pub use clips::SHORTEST;
pub use folder::{Imported, SplitCount, write_procedural};
pub use options::{Form, GroupBy, ImportError, ImportOptions, Rate, Skeleton, read_map};

use std::path::Path;

use clips::Clips;

/// Reads the motion in `options.from` and writes the data set `to`, whole.
///
/// # Errors
/// [`ImportError`]: there is no such file, nothing can be used, the folder is there already or cannot be
/// written. Files that cannot be used while others can are [`Imported::problems`].
pub fn import(options: &ImportOptions, to: &Path) -> Result<Imported, ImportError> {
    folder::check_place(to, options.overwrite)?;
    let listing = listing::list(options)?;
    let motions = match options.form {
        Form::Bvh => bvh::read(&listing.files, options),
        Form::Joints | Form::SmplxJoints | Form::Kit => joints::read(&listing, options)?,
    };
    let clips = Clips::of(motions, &listing, options)?;
    folder::write(clips, to)
}
