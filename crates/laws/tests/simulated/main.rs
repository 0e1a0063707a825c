//! What is promised of intervals and of rounds, against simulated sweeps. Minutes each, so not by default:
//!
//! `cargo test --release --test simulated -- --ignored --nocapture`

mod coverage;
mod rounds;
mod truths;
