//! `isoflop doctor`: checks the machine and the build.

use super::prelude::*;
use burn::tensor::{Device, Distribution, Tensor};
use isoflop::machine;
use isoflop::ops::{DeviceName, NoDevice, check_products, vectors};
use std::time::{Duration, Instant};

/// Rows and columns of the matrices that are multiplied.
const SIZE: usize = 512;

/// The time spent on multiplying.
const WHILE: Duration = Duration::from_millis(500);

/// The commands of Slurm that are used.
const SLURM: [&str; 4] = ["sbatch", "squeue", "sacct", "scancel"];

/// A check: its name, whether it passed, and the finding; `None` if a sweep does not need it.
type Finding = (&'static str, Option<bool>, String);

pub fn doctor(output: &Output) -> Result<Exit> {
    let build = [env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH];
    let [version, os, architecture] = build;
    let cores = std::thread::available_parallelism();
    let has_cores = cores.is_ok();
    let cores = cores.map_or_else(
        |error| format!("not told: {error}"),
        |cores| format!("{cores}: as many parallel runs"),
    );
    let memory = machine::available().map_or_else(
        || "unknown to the system; --memory sets the limit of jobs".to_string(),
        |bytes| format!("{:.1} GB free", bytes as f64 / 1e9),
    );
    let encoders = match cfg!(feature = "encoders") {
        true => "T5, CLIP, BERT and LLaMA from local weights",
        false => "hashed n-grams, files of vectors; T5 by --features encoders",
    };
    let mut findings: Vec<Finding> = vec![
        ("build", Some(true), format!("isoflop {version}, {os} {architecture}")),
        ("cores", Some(has_cores), cores),
        ("memory", None, memory),
    ];
    findings.extend(DeviceName::ALL.map(|(name, ..)| device(name)));
    let rest = [
        ("kernels", kernels()),
        ("speed", speed()),
        ("slurm", slurm()),
        ("text", encoders.to_string()),
    ];
    findings.extend(rest.map(|(what, found)| (what, None, found)));
    let fine = findings.iter().all(|(_, good, _)| *good != Some(false));
    let row = |(what, good, found): &Finding| {
        let word = good.map_or("-", |good| if good { "ok" } else { "FAILS" });
        [word.to_string(), (*what).to_string(), found.clone()]
    };
    let text = table(["<", "<", "<"], findings.iter().map(row));
    let told = findings
        .iter()
        .map(|(what, good, found)| json!({ "what": what, "good": good, "found": found }));
    output.result(&json!({ "good": fine, "findings": told.collect::<Vec<_>>() }), &text)?;
    Ok(if fine { Exit::Done } else { Exit::SomeRunsFailed })
}

/// A device that is not in this build is no fault; one that multiplies wrongly is.
fn device(name: DeviceName) -> Finding {
    let (good, found) = match name.open() {
        Err(NoDevice::NotInBuild(_)) => {
            (None, format!("not in this build; --features {}", name.name()))
        }
        Err(error) => (Some(false), error.to_string()),
        Ok(device) => match check_products(&device) {
            Ok(()) => (Some(true), "in this build, and multiplies correctly".to_string()),
            Err(error) => (Some(false), error.to_string()),
        },
    };
    (name.name(), good, found)
}

/// The instructions of the own kernels.
fn kernels() -> String {
    let used = vectors().unwrap_or("none");
    format!("{used}; ISOFLOP_VECTORS=portable, for one, chooses others")
}

/// Products of matrices on one core of this processor.
fn speed() -> String {
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
    let rate = rate / 1e9;
    format!("{rate:.0} GFLOP/s for {SIZE} × {SIZE} matrices; `isoflop plan` times runs")
}

fn slurm() -> String {
    let missing: Vec<&str> = SLURM.into_iter().filter(|name| !is_on_path(name)).collect();
    match missing.len() {
        0 => "found; `isoflop run --engine slurm`".to_string(),
        all if all == SLURM.len() => "not on this machine".to_string(),
        _ => format!("without {}", missing.join(", ")),
    }
}

fn is_on_path(name: &str) -> bool {
    let has = |folders| std::env::split_paths(&folders).any(|folder| folder.join(name).is_file());
    std::env::var_os("PATH").is_some_and(has)
}
