//! [`Place`]: a test's own directory, in which it runs the program.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use isoflop::files::digest;
use serde_json::Value;
use tempfile::TempDir;

/// One run, trained by `sh train.sh` with its spec, result and checkpoint as `$1`, `$2` and `$3`.
pub const OWN: &str = r#"name: own
data: {source: none}
trainer: {command: "sh train.sh {spec} {out} {checkpoint}"}
grid:
  models: [{n_layer: 1, n_head: 1, d_model: 8}]
  vocab: [64]
  budgets: [1e9]
fit: {bootstrap: 10}
"#;

/// A directory of a test's own, gone with the value.
pub struct Place(TempDir);

impl Place {
    /// An empty one.
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary directory"))
    }

    /// One that holds a sweep of `tests/sweeps` under its own name.
    pub fn with(sweep: &str) -> Self {
        let place = Self::new();
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sweeps").join(sweep);
        fs::copy(&from, place.path(sweep)).expect("the sweep is there");
        place
    }

    /// One that holds [`OWN`] as `own.yaml`, and its trainer.
    pub fn trained_by(script: &str) -> Self {
        let place = Self::new();
        place.write("own.yaml", OWN);
        place.write("train.sh", script);
        place
    }

    /// `name` in the directory.
    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("a writable directory");
    }

    /// The content of a file.
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The content of a JSON file, without its digest.
    pub fn json(&self, name: &str) -> Value {
        let bytes = digest::without(self.read(name));
        serde_json::from_slice(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// Names in a folder, sorted; those that begin with a dot are left out.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap_or_else(|e| panic!("{folder}: {e}"));
        let names = entries.map(|entry| entry.expect("a readable entry").file_name());
        let names = names.map(|name| name.into_string().expect("names are UTF-8"));
        let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
        names.sort();
        names
    }

    /// The program, to be started in the directory.
    pub fn program(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_isoflop"));
        command.args(args).current_dir(self.0.path());
        command.env_remove("RUST_LOG").env_remove("NO_COLOR").env_remove("CLICOLOR_FORCE");
        command
    }

    /// Runs the program to its end.
    pub fn isoflop(&self, args: &[&str]) -> Ended {
        let output = self.program(args).output().expect("the binary can be started");
        Ended { what: args.join(" "), output }
    }
}

/// How the program ended, and what it said.
pub struct Ended {
    what: String,
    output: Output,
}

impl Ended {
    /// The end of a program that was started in another way.
    pub fn of(args: &[&str], output: Output) -> Self {
        Self { what: args.join(" "), output }
    }

    /// The exit code.
    pub fn code(&self) -> Option<i32> {
        self.output.status.code()
    }

    /// Requires an exit code.
    pub fn exits(self, code: i32) -> Self {
        let found = self.output.status;
        assert_eq!(found.code(), Some(code), "isoflop {}: {found}\n{}", self.what, self.stderr());
        self
    }

    /// Requires words on standard error.
    pub fn says(self, words: &str) -> Self {
        let stderr = self.stderr();
        assert!(stderr.contains(words), "isoflop {}: no `{words}` in:\n{stderr}", self.what);
        self
    }

    /// Requires that words are not on standard error.
    pub fn does_not_say(self, words: &str) -> Self {
        let stderr = self.stderr();
        assert!(!stderr.contains(words), "isoflop {}: `{words}` in:\n{stderr}", self.what);
        self
    }

    /// Standard output.
    pub fn stdout(&self) -> String {
        String::from_utf8(self.output.stdout.clone()).expect("output is UTF-8")
    }

    /// Standard error.
    pub fn stderr(&self) -> String {
        String::from_utf8(self.output.stderr.clone()).expect("output is UTF-8")
    }

    /// Standard output as the one JSON document that it must be.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.stdout())
            .unwrap_or_else(|error| panic!("isoflop {}: {error} in {}", self.what, self.stdout()))
    }
}
