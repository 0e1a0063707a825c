//! [`Cluster`]: the Slurm that the tests have for themselves, and sweeps on it.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

use serde_json::Value;

use super::support::processes::wait_for;
use super::support::{Ended, Place};

/// Far longer than any but the quickstart takes, with every node lost once.
const PATIENCE: Duration = Duration::from_secs(150);

/// The same for the quickstart, on a machine that does other work too.
const LONG_PATIENCE: Duration = Duration::from_secs(3600);

/// What the sweeps ask for: little, so that several fit, and no waiting for a network's files.
const PROFILE: &str = "{partition: main, time: 10, mem: 100M, fs_grace_s: 2, cancel_grace_s: 30}\n";

/// The cluster that `tests/slurm/slurm-up.sh` made; one test at a time has it.
pub struct Cluster(
    #[expect(dead_code, reason = "held until it is dropped")] MutexGuard<'static, ()>,
);

/// The cluster, healthy; `None` if there is none, which is said.
pub fn cluster() -> Option<Cluster> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    if std::env::var_os("SLURM_DEV_DIR").is_none() {
        eprintln!("SKIPPED: no Slurm; `just test-slurm` brings one up");
        return None;
    }
    let guard = ONE_AT_A_TIME.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let cluster = Cluster(guard);
    cluster.heal();
    Some(cluster)
}

impl Cluster {
    /// Starts what a test has killed.
    pub fn heal(&self) {
        self.tool("slurm-up.sh", &[]);
    }

    /// Ends a node as a power cut would.
    pub fn kill_node(&self, node: &str) {
        self.tool("kill-node.sh", &[node]);
    }

    /// The node of a task that is running.
    pub fn node_at_work(&self) -> String {
        let said = self.ask("squeue", &["-h", "-t", "running", "-o", "%N"]);
        said.lines().next().expect("a task is running").trim().to_string()
    }

    /// Whether Slurm has noticed that a node is gone.
    pub fn is_down(&self, node: &str) -> bool {
        self.ask("sinfo", &["-h", "-n", node, "-o", "%t"]).contains("down")
    }

    fn tool(&self, name: &str, arguments: &[&str]) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/slurm").join(name);
        let output = Command::new(&path).args(arguments).output().expect("a script of ours");
        assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    }

    /// The process of a daemon, by the name of its file of `run`.
    pub fn daemon(&self, name: &str) -> nix::unistd::Pid {
        let folder = PathBuf::from(std::env::var_os("SLURM_DEV_DIR").expect("it was looked at"));
        let text = std::fs::read_to_string(folder.join("run").join(format!("{name}.pid")));
        let pid = text.expect("the daemon has a file").trim().parse().expect("a number");
        nix::unistd::Pid::from_raw(pid)
    }

    /// What one of Slurm's programs says.
    pub fn ask(&self, program: &str, arguments: &[&str]) -> String {
        let output = Command::new(program).args(arguments).output().expect("Slurm is installed");
        String::from_utf8_lossy(&output.stdout).into_owned()
    }
}

/// A sweep in a place of its own, submitted with the profile above.
pub struct OnSlurm {
    pub place: Place,
    /// Of the sweep, of its file without the ending, and of its folder in `results`.
    name: &'static str,
    settings: Vec<&'static str>,
    patience: Duration,
}

impl OnSlurm {
    /// `mini.yaml` with settings laid over it.
    pub fn mini(settings: &[&'static str]) -> Self {
        Self::at(Place::with("mini.yaml"), settings)
    }

    /// `language.yaml`: tokenizers with language, and two kinds of generators.
    pub fn language() -> Self {
        Self { name: "language", ..Self::at(Place::with("language.yaml"), &[]) }
    }

    /// `scored.yaml`: an evaluator, and runs that are scored.
    pub fn scored() -> Self {
        Self { name: "scored", ..Self::at(Place::with("scored.yaml"), &[]) }
    }

    /// `mini.yaml` in a given place.
    pub fn at(place: Place, settings: &[&'static str]) -> Self {
        place.write("profile.yaml", PROFILE);
        let settings = settings.iter().flat_map(|setting| ["--set", setting]).collect();
        Self { place, name: "mini", settings, patience: PATIENCE }
    }

    /// `experiments/quickstart.yaml`, with more checkpoints.
    pub fn quickstart() -> Self {
        let place = Place::new();
        place.write("quickstart.yaml", include_str!("../../experiments/quickstart.yaml"));
        let mini = Self::at(place, &["train.checkpoint_s=1"]);
        Self { name: "quickstart", patience: LONG_PATIENCE, ..mini }
    }

    /// Lays further keys over the profile.
    pub fn with_profile(self, keys: &str) -> Self {
        let all = PROFILE.trim_end().trim_end_matches('}');
        self.place.write("profile.yaml", format!("{all}, {keys}}}\n"));
        self
    }

    /// `isoflop run` of the sweep.
    fn run(&self, more: &[&str]) -> Ended {
        let file = format!("{}.yaml", self.name);
        self.place.isoflop(&[&["run", &file], &self.settings[..], more].concat())
    }

    /// Submits what is missing.
    pub fn submit(&self) -> Ended {
        self.run(&["--engine", "slurm", "--profile", "profile.yaml"])
    }

    /// Asks whether it would be taken.
    pub fn check(&self) -> Ended {
        self.run(&["--engine", "slurm", "--profile", "profile.yaml", "--check"])
    }

    /// The same sweep on this machine, in a folder of its own.
    pub fn locally(&self) -> PathBuf {
        let results = self.place.path("local");
        if !results.exists() {
            self.run(&["--out", "local", "--jobs", "2"]).exits(0);
        }
        results.join(self.name)
    }

    /// The sweep's folder.
    pub fn results(&self) -> PathBuf {
        self.place.path(&self.in_results(""))
    }

    fn in_results(&self, path: &str) -> String {
        format!("results/{}/{path}", self.name)
    }

    /// `isoflop status`.
    pub fn status(&self) -> Value {
        self.place.isoflop(&["status", &self.in_results(""), "--json"]).exits(0).json()
    }

    /// Waits until something is to be seen of the state.
    pub fn until(&self, what: &str, seen: impl Fn(&Value) -> bool) -> Value {
        let found = wait_for(self.patience, || {
            std::thread::sleep(Duration::from_millis(200));
            Some(self.status()).filter(&seen)
        });
        found.unwrap_or_else(|| panic!("{what} never came:\n{:#}\n{}", self.status(), self.logs()))
    }

    /// Waits until Slurm has nothing of the sweep any more.
    pub fn over(&self) -> Value {
        self.until("the end", |state| active(state) == Some(0))
    }

    /// Waits until a run has left a checkpoint and is at work.
    pub fn at_work(&self) {
        self.until("a checkpoint of a run at work", |state| {
            let runs = self.place.names(&self.in_results("runs"));
            let path = |run| format!("{run}/checkpoint/state.safetensors");
            let written = |run| self.results().join("runs").join(path(run)).exists();
            let written = runs.into_iter().any(written);
            written && state["runs"]["running"] != 0
        });
    }

    /// Everything that tasks wrote.
    pub fn logs(&self) -> String {
        let folder = self.in_results("slurm/logs");
        let names = self.place.names(&folder);
        let log = |name| {
            let text = self.place.read(&format!("{folder}/{name}"));
            format!("== {name}\n{}", String::from_utf8_lossy(&text))
        };
        names.into_iter().map(log).collect()
    }

    /// How many jobs tasks have brought to their end.
    pub fn jobs_done(&self) -> usize {
        let done = |line: &&str| line.starts_with('[') && line.contains(" done");
        self.logs().lines().filter(done).count()
    }
}

/// Tasks that may still do something; `None` if Slurm gave no answer.
pub fn active(state: &Value) -> Option<u64> {
    let queue = &state["slurm"];
    let of = |name: &str| queue[name].as_u64();
    let known = queue["known"].as_bool()?;
    known.then(|| Some(of("tasks_running")? + of("tasks_waiting")? + of("tasks_busy")?)).flatten()
}
