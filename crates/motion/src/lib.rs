//! Human motion with captions: files, features, other skeletons, and a procedural source. Without burn.
//!
//! The table has the same form as the program's; `tests/floors.rs` reads both.
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | [`motion`] | joints into features and back, into BVH, from other skeletons; the procedural source | |
//! | 2 | [`data`] | clips with captions from a folder or the procedural source; imports of other files | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod data;
pub mod motion;

use isoflop_spec::{failure, files, progress, spec};
