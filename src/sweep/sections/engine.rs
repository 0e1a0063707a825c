//! The `engine` section, and time limits in Slurm's notation.

use std::borrow::Cow;
use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize};
use serde_yaml::Value;

use crate::machine::{self, Card};
use crate::units::number;

/// The `engine` section: how an engine is to be used, not which: that is `--engine`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct EngineSection {
    /// The card that runs are trained on (`h100`; `isoflop plan --help` lists all): `plan` then gives GPU hours
    /// and memory, `run` refuses a run that does not fit, and Slurm is asked for one GPU for each task.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gpu: Option<String>,
    /// Model FLOPs utilisation, e.g. `0.35`: the fraction of the card's bf16 peak that runs reach, counted in FLOPs
    /// of their budgets. Finished runs of the folder override it; without either it is taken from an H200, by model size.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<f64>", range(min = 1e-6, max = 1))]
    pub mfu: Option<Amount>,
    /// The requests of `--engine slurm` to Slurm.
    pub slurm: SlurmSection,
}

impl EngineSection {
    /// The card of `gpu`; `None` if it is left out or not known.
    pub fn card(&self) -> Option<&'static Card> {
        self.gpu.as_deref().and_then(machine::find)
    }
}

/// A word or a number, kept as text: `time: 30`, `time: 2-00:00:00`, `mem: 4G`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(transparent)]
pub struct Word(pub String);

impl<'de> Deserialize<'de> for Word {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            Value::String(text) => Ok(Self(text)),
            Value::Number(number) => Ok(Self(number.to_string())),
            _ => Err(serde::de::Error::custom("expected a word or a number")),
        }
    }
}

impl JsonSchema for Word {
    fn schema_name() -> Cow<'static, str> {
        "Word".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({"type": ["string", "number"]})
    }
}

/// A number of seconds, minutes, tasks or FLOPs, written `30`, `0.5` or `1e9`.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Amount(#[serde(deserialize_with = "number::read")] pub f64);

/// A whole number, written `8` or `1e3`.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(transparent)]
pub struct Count(#[serde(deserialize_with = "number::read")] pub usize);

/// Two sections from one list of keys: the overrides of a stage, and the whole.
macro_rules! sections {
    (
        resources { $($(#[$about:meta])* $key:ident: $type:ty,)* }
        whole { $($(#[$of_all:meta])* $general:ident: $kind:ty,)* }
    ) => {
        /// The request of a job. Every key is optional; then Slurm's own default applies.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct Resources {
            $($(#[$about])* #[serde(skip_serializing_if = "Option::is_none")] pub $key: Option<$type>,)*
        }

        impl Resources {
            /// These keys over those `below`.
            pub fn over(self, below: Self) -> Self {
                Self { $($key: self.$key.or(below.$key),)* }
            }
        }

        /// The `engine.slurm` section, and a profile file. Every key may be left out.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct SlurmSection {
            $($(#[$about])* #[serde(skip_serializing_if = "Option::is_none")] pub $key: Option<$type>,)*
            $($(#[$of_all])* #[serde(skip_serializing_if = "Option::is_none")] pub $general: Option<$kind>,)*
        }

        impl SlurmSection {
            /// This section over the one `below`.
            pub fn over(self, below: Self) -> Self {
                Self {
                    $($key: self.$key.or(below.$key),)*
                    $($general: self.$general.or(below.$general),)*
                }
            }

            /// The request of every job.
            pub fn resources(&self) -> Resources {
                Resources { $($key: self.$key.clone(),)* }
            }
        }
    };
}

sections! {
    resources {
        /// `--partition`.
        partition: String,
        /// `--account`.
        account: String,
        /// `--qos`.
        qos: String,
        /// `--reservation`.
        reservation: String,
        /// `--constraint`: features of a node, as `zen4&ib`.
        constraint: String,
        /// `--exclude`: nodes to stay away from.
        exclude: String,
        /// `--nodelist`: nodes to run on.
        nodelist: String,
        /// `--time`, as Slurm writes it: `30` minutes, `04:00:00`, `2-12:00:00`.
        time: Word,
        /// `--cpus-per-task`, 1 if left out: as many jobs of a chunk run side by side.
        #[schemars(with = "Option<usize>", range(min = 1, max = 65_536))]
        cpus_per_task: Count,
        /// Parallel jobs of a chunk, if not one per CPU: 1 for one GPU.
        #[schemars(with = "Option<usize>", range(min = 1, max = 65_536))]
        runs_at_once: Count,
        /// `--mem`: memory of a task, as `8G`. One of the three at most.
        mem: Word,
        /// `--mem-per-cpu`.
        mem_per_cpu: Word,
        /// `--mem-per-gpu`.
        mem_per_gpu: Word,
        /// `--gpus`: GPUs of a task. One of the three at most; 0 is left out.
        gpus: Word,
        /// `--gres`, as `gpu:a100:1`.
        gres: Word,
        /// `--gpus-per-task`.
        gpus_per_task: Word,
        /// `--nice`.
        nice: Word,
        /// Lines of the batch script before the program: `module load`, `source`.
        preamble: Vec<String>,
        /// Words before the program: `[apptainer, exec, image.sif]`. This launcher must pass signals
        /// on.
        launcher: Vec<String>,
        /// Variables that the batch script sets.
        env: BTreeMap<String, Word>,
        /// Further arguments of `sbatch`, placed last, so they take precedence.
        extra: Vec<String>,
    }
    whole {
        /// Overrides for single stages: `inputs`, `train`, `fit`.
        stages: BTreeMap<Stage, Resources>,
        /// Tasks of the arrays that run at once at most (`%` of `--array`).
        #[schemars(with = "Option<usize>", range(min = 1, max = 1_000_000))]
        array_parallel: Count,
        /// Tasks of an array at most; asked of Slurm (MaxArraySize) where left out.
        #[schemars(with = "Option<usize>", range(min = 1, max = 1_000_000_000))]
        max_array: Count,
        /// Tasks of a submission at most; none if left out.
        #[schemars(with = "Option<usize>", range(min = 1, max = 1_000_000_000))]
        max_submit: Count,
        /// Minutes of work of a task, 30 where left out; half of `time` at most.
        #[schemars(with = "Option<f64>", range(min = 1e-3, max = 1e6))]
        target_chunk_minutes: Amount,
        /// FLOPs a second of one job, by which runs are packed; where left out, measured by the
        /// finished runs of the folder, or else here by a few steps.
        #[schemars(with = "Option<f64>", range(min = 1, max = 1e21))]
        flops_per_second: Amount,
        /// Seconds before the time limit at which a task is warned and checkpoints; 120.
        #[schemars(with = "Option<usize>", range(min = 0, max = 1_000_000))]
        signal_grace_s: Count,
        /// Whether Slurm may put a task back into the queue: preempted, node lost, out of time; true.
        requeue: bool,
        /// Times that a task puts itself back when its time is over; 20.
        #[schemars(with = "Option<usize>", range(min = 0, max = 1_000_000))]
        max_requeues: Count,
        /// Seconds that `isoflop cancel` waits for checkpoints before it ends tasks the hard way; 60.
        #[schemars(with = "Option<f64>", range(min = 0, max = 1e6))]
        cancel_grace_s: Amount,
        /// Seconds that a task waits for files written on another machine to appear; 90.
        #[schemars(with = "Option<f64>", range(min = 0, max = 1e6))]
        fs_grace_s: Amount,
        /// Whether laws are fitted although runs are missing; false.
        allow_missing: bool,
        /// `--export`: `ALL`, `NIL` or names of variables; ALL.
        export: String,
        /// `--clusters`.
        clusters: String,
        /// The program, with arguments before its own; split as a shell splits words.
        sbatch: String,
        /// As `sbatch`.
        squeue: String,
        /// As `sbatch`.
        scancel: String,
        /// As `sbatch`.
        scontrol: String,
    }
}

/// A part of a sweep that is a separate job of Slurm.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum Stage {
    /// Captions, tokenizers and codes.
    Inputs,
    /// Trunks and runs.
    Train,
    /// Table, laws, figures.
    Fit,
}

impl Stage {
    /// The word in names of jobs and files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Inputs => "inputs",
            Self::Train => "train",
            Self::Fit => "fit",
        }
    }
}

/// Minutes of a time limit as Slurm writes it: `90`, `90:30`, `4:00:00`, `2-12`, `2-12:00`, `2-12:00:00`; `None` if
/// it is none, or has no end.
pub fn minutes(text: &str) -> Option<f64> {
    let (days, rest) = match text.trim().split_once('-') {
        Some((days, rest)) => (Some(digits(days)?), rest),
        None => (None, text.trim()),
    };
    let parts: Vec<f64> = rest.split(':').map(digits).collect::<Option<_>>()?;
    let (hours, minutes, seconds) = match (days, parts[..].as_ref()) {
        (None, [minutes]) => (0.0, *minutes, 0.0),
        (None, [minutes, seconds]) => (0.0, *minutes, *seconds),
        (Some(_), [hours]) => (*hours, 0.0, 0.0),
        (Some(_), [hours, minutes]) => (*hours, *minutes, 0.0),
        (_, [hours, minutes, seconds]) => (*hours, *minutes, *seconds),
        _ => return None,
    };
    let minutes = (days.unwrap_or(0.0) * 24.0 + hours) * 60.0 + minutes + seconds / 60.0;
    (minutes > 0.0).then_some(minutes)
}

fn digits(text: &str) -> Option<f64> {
    let all = !text.is_empty() && text.chars().all(|c| c.is_ascii_digit());
    all.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::minutes;

    #[test]
    fn every_form_that_slurm_takes_is_read_and_no_other() {
        let good = [
            ("90", 90.0),
            ("1:30", 1.5),
            ("4:00:00", 240.0),
            ("1-02", 1560.0),
            ("1-02:03", 1563.0),
            ("1-02:03:30", 1563.5),
        ];
        for (text, expected) in good {
            assert_eq!(minutes(text), Some(expected), "{text}");
        }
        for text in ["", "0", "4h", "1:2:3:4", "-1", "UNLIMITED", "1-", "1e2"] {
            assert_eq!(minutes(text), None, "{text}");
        }
    }
}
