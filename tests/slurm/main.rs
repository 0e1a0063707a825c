//! Sweeps on a real Slurm: `just test-slurm` brings a throw-away cluster up, runs these and takes it
//! down. Without one they are skipped, and say so.

mod cluster;
mod faults;
mod life;
mod results;
#[expect(dead_code, unused_imports, reason = "the tests of the command line use the rest")]
#[path = "../support/mod.rs"]
mod support;
