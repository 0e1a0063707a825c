//! What is trained, as plain data that is hashed, and what every crate above needs of the machine: files,
//! signals, memory. Free of burn.
//!
//! The table has the form of that of the program; `tests/floors.rs` reads both.
//!
//! | floor | module | what it is for | beside it |
//! | --- | --- | --- | --- |
//! | 1 | [`units`] | numbers and amounts of memory as people write them | |
//! | 1 | [`failure`] | what can go wrong with a job, as a type | |
//! | 1 | [`machine`] | memory of this machine, and kills for the lack of it; GPUs by name | |
//! | 1 | [`files`] | files written whole, mapped, or set aside | failure |
//! | 1 | [`progress`] | steps, pieces of work, requests to stop | failure, files |
//! | 2 | [`spec`] | closed descriptions of what is trained and on what, with its FLOPs and its id | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod failure;
pub mod files;
pub mod machine;
pub mod progress;
pub mod spec;
pub mod units;
