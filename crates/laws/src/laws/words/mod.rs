//! Numbers and sentences for a terminal.

pub mod text;
