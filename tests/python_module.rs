//! The Python module's calls, with this build's program; where there is a Python.

use std::path::Path;
use std::process::Command;

#[test]
fn the_calls_of_the_python_module_agree_with_the_program() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = Command::new("python3")
        .args(["-W", "error", "-m", "unittest", "discover", "python/tests"])
        .current_dir(root)
        .env("ISOFLOP_PROGRAM", env!("CARGO_BIN_EXE_isoflop"))
        .env("PYTHONPATH", "python")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output();
    let Ok(ended) = python else {
        eprintln!("skipped: python3 is not installed");
        return;
    };
    let said = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && said.contains("OK"), "{said}");
}
