//! The interpreter with PyTorch, for tests that skip themselves if there is none.

use std::path::{Path, PathBuf};
use std::process::Command;

/// `ISOFLOP_PYTHON`, or else `python3`.
fn interpreter() -> PathBuf {
    let named = std::env::var_os("ISOFLOP_PYTHON").filter(|name| !name.is_empty());
    named.map_or_else(|| PathBuf::from("python3"), PathBuf::from)
}

/// The interpreter, if it has what the trainers in PyTorch import.
pub fn python() -> Option<PathBuf> {
    let python = interpreter();
    let libraries = ["-c", "import torch, numpy, safetensors"];
    let asked = Command::new(&python).args(libraries).output();
    if asked.is_ok_and(|ended| ended.status.success()) {
        return Some(python);
    }
    eprintln!("skipped: {} has no torch", python.display());
    None
}

/// Has a program find this tree's Python package.
pub fn with_package(command: &mut Command) -> &mut Command {
    command.env("PYTHONPATH", Path::new(env!("CARGO_MANIFEST_DIR")).join("python"))
}
