//! Inputs of a kind, one after another, and what is told of those that fail.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{env, fs, process, thread};

use isoflop::draws::stream;
use rand_chacha::ChaCha8Rng;

use crate::limits::{hold_panics, is_reading, limited};

/// A kind of file that is read.
pub struct Kind {
    pub name: &'static str,
    /// The name of the file in a folder of its own.
    pub file: &'static str,
    /// Writes what the reader needs beside the file, and gives files that it accepts.
    pub seeds: fn(&Path) -> Vec<Vec<u8>>,
    /// A file made of accepted ones.
    pub mutate: fn(&[Vec<u8>], &mut ChaCha8Rng) -> Vec<u8>,
    /// Reads the file and uses what was read; the error's words where it is refused.
    pub read: fn(&Path) -> Result<(), String>,
}

/// Kinds take their turns, so that memory and time are those of one input.
static TURN: Mutex<()> = Mutex::new(());

/// Different failures that are told of a kind.
const MOST_TOLD: usize = 8;

/// Meets inputs for as long as the environment says.
///
/// # Panics
/// An input fails.
pub fn fuzz(kind: &Kind) {
    let _turn = TURN.lock().unwrap_or_else(|turn| turn.into_inner());
    let (place, plan) = (place(kind, in_memory()), Plan::of_environment());
    let seeds = (kind.seeds)(&place);
    let mut tally = Tally::default();
    for seed in &seeds {
        let told = tally.read(kind, &place, seed, "a seed");
        let refused = told.and_then(Result::err);
        assert!(
            refused.is_none(),
            "{}: a seed is refused: {}",
            kind.name,
            refused.unwrap_or_default()
        );
    }
    tally = Tally { failed: tally.failed, ..Tally::default() };
    let begun = Instant::now();
    for input in plan.inputs() {
        let bytes = (kind.mutate)(&seeds, &mut stream(plan.seed, input));
        tally.read(kind, &place, &bytes, &format!("{}:{input}", plan.seed));
        if tally.failed.len() >= MOST_TOLD || !plan.goes_on(input, begun) {
            break;
        }
    }
    let _ = fs::remove_dir_all(place);
    eprintln!("{}", tally.line(kind, plan.seed));
    assert!(tally.failed.is_empty(), "{}", tally.told(kind));
}

/// Meets the kept inputs of a kind.
///
/// # Panics
/// An input fails.
pub fn replay(kind: &Kind) {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/fuzz").join(kind.name);
    let Ok(entries) = fs::read_dir(&kept) else { return };
    let _turn = TURN.lock().unwrap_or_else(|turn| turn.into_inner());
    let place = place(kind, in_memory());
    let _ = (kind.seeds)(&place);
    let mut tally = Tally::default();
    for entry in entries {
        let path = entry.expect("a readable folder").path();
        let bytes = fs::read(&path).expect("a readable file");
        tally.read(kind, &place, &bytes, &path.display().to_string());
    }
    let _ = fs::remove_dir_all(place);
    assert!(tally.failed.is_empty(), "{}", tally.told(kind));
}

/// Meets one input that is made up.
///
/// # Panics
/// It fails.
pub fn one(kind: &Kind, bytes: &[u8]) {
    let _turn = TURN.lock().unwrap_or_else(|turn| turn.into_inner());
    let place = place(kind, on_disk());
    let _ = (kind.seeds)(&place);
    let mut tally = Tally::default();
    tally.read(kind, &place, bytes, "made up");
    let _ = fs::remove_dir_all(place);
    eprintln!("{}", tally.line(kind, 0));
    assert!(tally.failed.is_empty(), "{}", tally.told(kind));
}

/// An empty folder for the files of a kind, of this process alone.
fn place(kind: &Kind, parent: &Path) -> PathBuf {
    hold_panics();
    let place = parent.join(format!("isoflop-fuzz-{}-{}", process::id(), kind.name));
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&place).expect("a writable folder");
    place
}

fn on_disk() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// A folder in memory, if there is one: readers that write whole files wait for a disk longer than they work.
fn in_memory() -> &'static Path {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { memory } else { on_disk() }
}

// What the environment asks for.

struct Plan {
    seed: u64,
    /// The one input that is asked for.
    only: Option<u64>,
    inputs: Option<u64>,
    time: Duration,
}

/// Inputs of a kind in `cargo test`, of one seed, so that the tests of a commit meet the same ones everywhere.
const QUICK_INPUTS: u64 = 200;

impl Plan {
    fn of_environment() -> Self {
        let number = |name: &str| -> Option<f64> {
            Some(env::var(name).ok()?.parse().unwrap_or_else(|_| panic!("{name} is a number")))
        };
        let clock =
            || SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_millis() as u64);
        let [seconds, inputs] = ["ISOFLOP_FUZZ_SECONDS", "ISOFLOP_FUZZ_INPUTS"].map(number);
        let is_quick = seconds.is_none() && inputs.is_none();
        let told = env::var("ISOFLOP_FUZZ_SEED").ok();
        let parts: Vec<u64> = told.iter().flat_map(|told| told.split(':')).map(whole).collect();
        Self {
            seed: parts.first().copied().unwrap_or_else(|| if is_quick { 0 } else { clock() }),
            only: parts.get(1).copied(),
            inputs: if is_quick { Some(QUICK_INPUTS) } else { inputs.map(|n| n as u64) },
            time: Duration::from_secs_f64(seconds.unwrap_or(2.0)),
        }
    }

    fn inputs(&self) -> std::ops::Range<u64> {
        self.only.map_or(0..self.inputs.unwrap_or(u64::MAX), |only| only..only + 1)
    }

    fn goes_on(&self, input: u64, begun: Instant) -> bool {
        self.inputs.map_or_else(|| begun.elapsed() < self.time, |inputs| input + 1 < inputs)
    }
}

fn whole(text: &str) -> u64 {
    text.parse()
        .unwrap_or_else(|_| panic!("ISOFLOP_FUZZ_SEED is SEED or SEED:INPUT, and not {text}"))
}

// What became of the inputs.

#[derive(Default)]
struct Tally {
    inputs: usize,
    accepted: usize,
    slowest_s: f64,
    most_bytes: usize,
    /// How inputs failed, by what distinguishes failures.
    failed: BTreeMap<String, String>,
}

impl Tally {
    /// Reads an input; what the reader said, or `None` where it failed.
    fn read(
        &mut self,
        kind: &Kind,
        place: &Path,
        bytes: &[u8],
        name: &str,
    ) -> Option<Result<(), String>> {
        let path = place.join(kind.file);
        // A new file: one that is mapped keeps its bytes.
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).expect("a writable folder");
        watched(&path, name);
        let (took, said) = limited(|| (kind.read)(&path));
        self.inputs += 1;
        self.accepted += usize::from(matches!(said, Ok(Ok(()))));
        self.slowest_s = self.slowest_s.max(took.seconds);
        self.most_bytes = self.most_bytes.max(took.bytes);
        said.map_err(|problem| self.fail(kind, bytes, name, &problem)).ok()
    }

    fn fail(&mut self, kind: &Kind, bytes: &[u8], name: &str, problem: &str) {
        let alike: String = problem.chars().filter(|c| !c.is_ascii_digit()).take(120).collect();
        if self.failed.contains_key(&alike) {
            return;
        }
        let folder = on_disk().join("fuzz-failed").join(kind.name);
        fs::create_dir_all(&folder).expect("a writable folder");
        let hash = &blake3::hash(bytes).to_hex()[..8];
        let name_of_file = Path::new(kind.file).file_name().unwrap_or_default().to_string_lossy();
        let path = folder.join(format!("{hash}-{name_of_file}"));
        fs::write(&path, bytes).expect("a writable folder");
        let shown = path.display();
        self.failed
            .insert(alike, format!("{problem}\n  the input is {shown}\n  again: {}", again(name)));
    }

    fn line(&self, kind: &Kind, seed: u64) -> String {
        format!(
            "fuzz {}: {} inputs of seed {seed}, {:.1} % accepted, slowest {:.0} ms, most {:.1} MB",
            kind.name,
            self.inputs,
            100.0 * self.accepted as f64 / self.inputs.max(1) as f64,
            1e3 * self.slowest_s,
            self.most_bytes as f64 / 1e6
        )
    }

    fn told(&self, kind: &Kind) -> String {
        let all: Vec<&str> = self.failed.values().map(String::as_str).collect();
        format!("{} ({}):\n{}", kind.name, all.len(), all.join("\n"))
    }
}

/// The command that meets an input again.
fn again(name: &str) -> String {
    let test = thread::current().name().unwrap_or_default().to_string();
    format!("ISOFLOP_FUZZ_SEED={name} cargo test --release --test fuzz -- --exact {test}")
}

// An input that has no end is told by a thread of its own.

/// Longer than any machine takes for an input within the limits.
const NO_END: Duration = Duration::from_secs(100);

/// From here on, `path` is read; where that does not end, the process does.
fn watched(path: &Path, name: &str) {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    static NOW: Mutex<String> = Mutex::new(String::new());
    static ONCE: std::sync::Once = std::sync::Once::new();
    COUNT.fetch_add(1, Ordering::Relaxed);
    *NOW.lock().expect("no thread panics with it") =
        format!("{}\n  again: {}", path.display(), again(name));
    ONCE.call_once(|| {
        thread::spawn(|| {
            let (mut seen, mut since) = (0, Instant::now());
            loop {
                thread::sleep(Duration::from_secs(1));
                let now = COUNT.load(Ordering::Relaxed);
                if now != seen || !is_reading() {
                    (seen, since) = (now, Instant::now());
                } else if since.elapsed() > NO_END {
                    eprintln!("no end: {}", NOW.lock().expect("no thread panics with it"));
                    process::abort();
                }
            }
        });
    });
}
