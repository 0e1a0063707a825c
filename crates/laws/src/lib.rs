//! Scaling laws of runs: free of burn, of files of a sweep and of the command line.
//!
//! `IsoFlopPoint → Minimum → Law → Prediction`
//!
//! The table has the form of that of the program; `tests/floors.rs` reads both.
//!
//! | floor | module | what it is for | beside it |
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
