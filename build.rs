//! Tells the program which revision it was built from, for the records of its runs.

use std::process::Command;

fn main() {
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=crates");
    println!("cargo::rustc-env=ISOFLOP_GIT_REVISION={}", revision());
}

/// The short commit hash, with `-dirty` where files differ from it; `unknown` outside git.
fn revision() -> String {
    git(&["describe", "--always", "--dirty", "--exclude=*"])
        .unwrap_or_else(|| "unknown".to_string())
}

/// What git says; `None` outside git.
fn git(words: &[&str]) -> Option<String> {
    let output = Command::new("git").args(words).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
}
