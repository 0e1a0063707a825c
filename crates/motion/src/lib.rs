//! Human motion with captions: files, features, other people's skeletons, and a source that is made up. Free of
//! burn.
//!
//! The table has the form of that of the program; `tests/floors.rs` reads both.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`motion`] | joints into features and back, into BVH, from other skeletons; the procedural source | |
//! | 2 | [`data`] | a folder or the generator into clips with captions; other files into such a folder | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod data;
pub mod motion;

use isoflop_spec::{failure, files, progress, spec};
