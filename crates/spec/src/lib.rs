//! Specifications of training as plain, hashed data, and access to the machine for all crates above: files, signals,
//! memory. Without burn.
//!
//! The table has the same form as the program's; `tests/floors.rs` reads both.
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | [`units`] | numbers, their ranges and amounts of memory as users write them | |
//! | 1 | [`failure`] | kinds of failures of a job | |
//! | 1 | [`machine`] | memory of this machine, and out-of-memory kills; GPUs by name | |
//! | 1 | [`files`] | files written atomically, mapped, or set aside | failure |
//! | 1 | [`progress`] | progress of work, requests to stop | failure, files |
//! | 2 | [`spec`] | closed descriptions of models and data, with FLOPs and ids | |

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
