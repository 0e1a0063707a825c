//! What work tells of itself while it goes on, and how it is asked to stop.
//!
//! # Example
//!
//! ```
//! use isoflop::progress::Stop;
//!
//! let stop = Stop::default();
//! let asked_elsewhere = stop.clone();
//! asked_elsewhere.raise();
//! assert!(stop.is_raised());
//! ```

mod beats;
mod steps;
mod stop;

pub use beats::{Beat, Said, beats, forget_progress, note_progress, progress, tell_of_pieces};
pub use steps::{Progress, Step, moved, pieces};
pub use stop::{Stop, stop_on_signals};
