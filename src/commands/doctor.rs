//! `isoflop doctor`: what this machine and this build can do.

use super::prelude::*;
use burn::tensor::{Device, Distribution, Tensor};
use isoflop::machine;
use isoflop::ops::{DeviceName, check_products};
use std::time::{Duration, Instant};

/// Rows and columns of the matrices that are multiplied.
const SIZE: usize = 512;

/// How long is multiplied.
const WHILE: Duration = Duration::from_millis(500);

/// What Slurm is used by.
const SLURM: [&str; 4] = ["sbatch", "squeue", "sacct", "scancel"];

/// Something that was looked at.
#[derive(Serialize)]
struct Finding {
    what: &'static str,
    /// Whether a sweep runs with it; `None` where a sweep can do without.
    good: Option<bool>,
    found: String,
}

pub fn doctor(output: &Output) -> Result<Exit> {
    let mut findings = vec![build(), cores(), machine()];
    findings.extend(DeviceName::ALL.map(|(name, ..)| device(name)));
    findings.extend([speed(), slurm(), encoders()]);
    let fine = findings.iter().all(|finding| finding.good != Some(false));
    let text = table(["<", "<", "<"], findings.iter().map(row));
    output.result(&json!({ "good": fine, "findings": findings }), &text)?;
    Ok(if fine { Exit::Done } else { Exit::SomeRunsFailed })
}

fn row(Finding { what, good, found }: &Finding) -> [String; 3] {
    let word = match good {
        Some(true) => "ok",
        Some(false) => "FAILS",
        None => "-",
    };
    [word.to_string(), (*what).to_string(), found.clone()]
}

fn build() -> Finding {
    let found = format!(
        "isoflop {}, {} {}",
        env!("CARGO_PKG_VERSION"),
        std::env::consts::OS,
        std::env::consts::ARCH
    );
    Finding { what: "build", good: Some(true), found }
}

fn cores() -> Finding {
    let cores = std::thread::available_parallelism();
    let found = cores.as_ref().map_or_else(
        |error| format!("not told: {error}"),
        |cores| format!("{cores}: as many runs side by side"),
    );
    Finding { what: "cores", good: Some(cores.is_ok()), found }
}

fn machine() -> Finding {
    let found = machine::available().map_or_else(
        || "the system does not tell; --memory sets what jobs may take".to_string(),
        |bytes| format!("{:.1} GB to be had", bytes as f64 / 1e9),
    );
    Finding { what: "memory", good: None, found }
}

/// A device that is not in this build is nothing amiss; one that multiplies wrongly is.
fn device(name: DeviceName) -> Finding {
    let (good, found) = match name.open() {
        Err(_) => (None, format!("not in this build; --features {}", name.name())),
        Ok(device) => match check_products(&device) {
            Ok(()) => (Some(true), "in this build, and multiplies rightly".to_string()),
            Err(error) => (Some(false), error.to_string()),
        },
    };
    Finding { what: name.name(), good, found }
}

/// Products of matrices on one core of this processor.
fn speed() -> Finding {
    let device = Device::flex();
    let one = Tensor::<2>::random([SIZE, SIZE], Distribution::Default, &device);
    let flops = 2.0 * (SIZE as f64).powi(3);
    let began = Instant::now();
    let mut products = 0.0;
    while began.elapsed() < WHILE {
        let _ = one.clone().matmul(one.clone()).into_data();
        products += 1.0;
    }
    let rate = products * flops / began.elapsed().as_secs_f64();
    let found = format!(
        "{:.0} GFLOP/s in products of {SIZE} × {SIZE}; `isoflop plan` probes runs",
        rate / 1e9
    );
    Finding { what: "speed", good: None, found }
}

fn slurm() -> Finding {
    let missing: Vec<&str> = SLURM.into_iter().filter(|name| !is_on_path(name)).collect();
    let found = match missing.len() {
        0 => "found; `isoflop run --engine slurm`".to_string(),
        all if all == SLURM.len() => "not on this machine".to_string(),
        _ => format!("without {}", missing.join(", ")),
    };
    Finding { what: "slurm", good: None, found }
}

fn is_on_path(name: &str) -> bool {
    let has = |folders| std::env::split_paths(&folders).any(|folder| folder.join(name).is_file());
    std::env::var_os("PATH").is_some_and(has)
}

fn encoders() -> Finding {
    let found = match cfg!(feature = "encoders") {
        true => "T5, CLIP, BERT and LLaMA from local weights",
        false => "hashed n-grams, files of vectors; T5 by --features encoders",
    };
    Finding { what: "text", good: None, found: found.to_string() }
}
