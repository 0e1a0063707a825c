//! Tells the program which revision it was built from, for the records of its runs.

use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=.git/logs/HEAD");
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=crates");
    println!("cargo::rustc-env=ISOFLOP_GIT_REVISION={}", revision());
}

/// The short commit hash, with `-dirty` where files differ from it; `unknown` outside git.
fn revision() -> String {
    let described =
        Command::new("git").args(["describe", "--always", "--dirty", "--exclude=*"]).output();
    match described {
        Ok(output) if output.status.success() => {
            String::from_utf8_lossy(&output.stdout).trim().to_string()
        }
        _ => "unknown".to_string(),
    }
}
