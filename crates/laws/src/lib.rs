//! Scaling laws of runs, without burn, files of a sweep or the command line.
//!
//! `IsoFlopPoint → Minimum → Law → Prediction`
//!
//! The table has the same form as the program's; `tests/floors.rs` reads both.
//!
//! | floor | module | content | also imports |
//! | --- | --- | --- | --- |
//! | 1 | [`laws`] | points into minima, power laws and loss laws | |
//! | 2 | [`predict`] | laws and a budget into a configuration | |
//! | 2 | [`table`] | a table of runs made elsewhere into points | |

#![cfg_attr(
    not(test),
    warn(clippy::panic, clippy::print_stderr, clippy::print_stdout, clippy::unwrap_used)
)]

pub mod laws;
pub mod predict;
pub mod table;
