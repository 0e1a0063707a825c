//! Sweeps on a real Slurm: `just test-slurm` brings a throw-away cluster up, runs these and takes it
//! down. Without one they are skipped, and say so.

mod cluster;
mod faults;
mod life;
mod results;
// Shared with the tests of the command line, which use the rest.
#[allow(dead_code, unused_imports)]
#[path = "../support/mod.rs"]
mod support;
