//! [`Gpu`]: the hours that training takes on a card, by a stated MFU, and the memory.
//!
//! MFU (model FLOPs utilisation) is counted in FLOPs of the budgets, by the rule of the sweep: rows of captions,
//! which that rule may leave out, cost time and add nothing to it.

use super::folder::ResultsFolder;
use super::job::Job;
use super::speed::{Rate, rate_at, rates};
use crate::machine::Card;
use crate::plan::{Plan, PlannedRun, Trunk, bytes_on_card};
use crate::record::RunRecord;
use crate::spec::RunSpec;
use serde::Serialize;
use std::collections::HashSet;

/// N_nv of a model and its MFU in bf16, without the optimiser's part of a step.
///
/// The torch trainer on an H200 (`benches/gpu/shapes.py`, steps of 8192 tokens, V = 1024); 27 M to 731 M are
/// ScaMo's 44M to 775M. Below 27 M a step takes 8 to 9 ms whatever the size; that it does so at 10 k is **assumed**.
/// Slower cards have a higher MFU at small sizes, so their hours are overestimated.
const REFERENCE: [Rate; 8] = [
    (1e4, 0.000_11),
    (110.6e3, 0.0012),
    (852e3, 0.0058),
    (6.82e6, 0.0395),
    (27.27e6, 0.158),
    (84.9e6, 0.250),
    (308.3e6, 0.298),
    (731.4e6, 0.312),
];

/// Bytes that a step moves for each parameter, whatever its batch: AdamW, clipping, and weights in bf16 (by the
/// profile of the same runs).
const OPTIMISER_BYTES: f64 = 50.0;

/// Seconds from the start of the trainer to the first step: 10 for compiled kernels (measured), the rest for
/// Python and CUDA, **assumed**.
const START_S: f64 = 30.0;

/// Devices of records that do not say which card they were.
const UNNAMED: [&str; 4] = ["custom", "cuda", "vulkan", "wgpu"];

/// A card, and how much of its peak training uses.
#[derive(Clone, Debug)]
pub struct Gpu {
    pub card: &'static Card,
    /// N_nv and MFU, in the order of N_nv.
    mfu: Vec<Rate>,
    pub source: MfuSource,
}

/// The source of an MFU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "source", rename_all = "lowercase")]
pub enum MfuSource {
    /// The table in this file: an H200 at seven sizes, interpolated.
    Reference,
    /// `engine.mfu`.
    Told,
    /// Finished runs of the folder, so many.
    Measured { runs: usize },
}

impl Gpu {
    /// The card with the MFU of finished runs in the folder; else with `told`; else from the table.
    pub fn new(
        card: &'static Card,
        told: Option<f64>,
        plan: &Plan,
        folder: &ResultsFolder,
    ) -> Self {
        let finished = finished(card, plan, folder);
        let (runs, measured) = (finished.len(), rates(finished));
        if !measured.is_empty() {
            let mfu = measured.into_iter().map(|(n, rate)| (n, rate / card.peak_flops)).collect();
            return Self { card, mfu, source: MfuSource::Measured { runs } };
        }
        match told {
            Some(mfu) => Self { card, mfu: vec![(1.0, mfu)], source: MfuSource::Told },
            None => Self { card, mfu: REFERENCE.to_vec(), source: MfuSource::Reference },
        }
    }

    /// MFU of a model with `params_nonvocab` parameters (N_nv): linear in logarithms between known sizes, constant above
    /// the largest. Below the smallest measured size it falls like the table.
    pub fn mfu(&self, params_nonvocab: usize) -> f64 {
        let known = rate_at(&self.mfu, params_nonvocab);
        let least = self.mfu.first().map_or(1.0, |(n, _)| *n) as usize;
        match self.source {
            MfuSource::Measured { .. } if params_nonvocab < least => {
                known * rate_at(&REFERENCE, params_nonvocab) / rate_at(&REFERENCE, least)
            }
            _ => known,
        }
    }

    /// Hours that a run takes, alone on the card: 30 s to start, then own FLOPs / (peak · MFU); with the MFU of
    /// the table the optimiser's steps come on top.
    pub fn run_hours(&self, run: &PlannedRun) -> f64 {
        self.hours_of(&run.spec, run.own_flops(), run.own_flops() / run.spec.budget_flops)
    }

    /// The same for trunks.
    pub fn trunk_hours(&self, trunk: &Trunk) -> f64 {
        self.hours_of(&trunk.spec, trunk.flops, 1.0)
    }

    /// `share` is the part of the steps that is the run's own.
    fn hours_of(&self, spec: &RunSpec, flops: f64, share: f64) -> f64 {
        let params = spec.params();
        let products_s = flops / (self.card.peak_flops * self.mfu(params.nonvocab));
        let moved = OPTIMISER_BYTES * params.total() as f64 * spec.steps as f64 * share;
        let optimiser_s = match self.source {
            MfuSource::Reference => moved / self.card.bytes_per_s,
            MfuSource::Told | MfuSource::Measured { .. } => 0.0,
        };
        (START_S + products_s + optimiser_s) / 3600.0
    }

    /// Hours of the runs and trunks among these jobs, one after another, although small models leave room on the card: the
    /// saving by parallel runs is unknown.
    pub fn hours(&self, plan: &Plan, jobs: &[Job]) -> f64 {
        let wanted: HashSet<&str> = jobs.iter().map(|job| job.id.id.as_str()).collect();
        let runs = plan.runs.iter().filter(|run| wanted.contains(run.run_id.as_str()));
        let trunks = plan.trunks.iter().filter(|trunk| wanted.contains(trunk.trunk_id.as_str()));
        let runs = runs.map(|run| self.run_hours(run)).sum::<f64>();
        // The sum of nothing is −0.
        0.0 + runs + trunks.map(|trunk| self.trunk_hours(trunk)).sum::<f64>()
    }
}

/// Records of the finished runs that such a card may have trained, by N_nv. A damaged record is left out.
fn finished(card: &Card, plan: &Plan, folder: &ResultsFolder) -> Vec<(usize, RunRecord)> {
    let own = |run: &PlannedRun| {
        let record = folder.record(&run.run_id).ok().flatten()?;
        let device = record.measured.device.as_deref().unwrap_or_default();
        let has_time = record.measured.wall_s.is_some_and(|wall_s| wall_s > 0.0);
        let is_own = has_time && (card.is_named(device) || UNNAMED.contains(&device));
        is_own.then_some((run.params.nonvocab, record))
    };
    plan.runs.iter().filter_map(own).collect()
}

/// A sentence on runs that do not fit on the card, and the need of the largest; `None` if all fit, or for a user's
/// trainer.
pub fn too_large<'a>(
    card: &Card,
    runs: impl IntoIterator<Item = &'a PlannedRun>,
) -> Option<String> {
    let known = runs.into_iter().filter(|run| !run.spec.is_users_own());
    let bytes: Vec<u64> = known.map(|run| bytes_on_card(&run.spec)).collect();
    let large = bytes.iter().filter(|bytes| **bytes as f64 > card.memory_bytes);
    let (n, most) = large.fold((0, 0), |(n, most), bytes| (n + 1, most.max(*bytes)));
    (n > 0).then(|| {
        format!(
            "{n} of {} runs do not fit on one {}: the largest needs {:.1} GB of its {:.0} GB; name a larger \
             card, lower train.batch.max, or drop cells by grid.exclude",
            bytes.len(),
            card.name,
            most as f64 / 1e9,
            card.memory_bytes / 1e9,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::DataFacts;
    use crate::files::atomic::write_json;
    use crate::jobs::{JobId, all_jobs};
    use crate::{machine, sweep};

    fn plan(precision: &str) -> Plan {
        let text = format!(
            "name: a\ngrid: {{models: scamo, vocab: [1024], budgets: [1e17]}}\n\
             train: {{precision: {precision}, batch: 8192}}\n"
        );
        let sweep = sweep::parse("a.yaml", &text, &[]).unwrap();
        Plan::new(&sweep, DataFacts::absent(String::new()))
    }

    fn gpu(told: Option<f64>, plan: &Plan) -> Gpu {
        let card = machine::find("h100").unwrap();
        Gpu::new(card, told, plan, &ResultsFolder::new("/no/such/folder"))
    }

    #[test]
    fn hours_follow_from_the_stated_mfu() {
        let plan = plan("bf16");
        let gpu = gpu(Some(0.5), &plan);
        assert_eq!(gpu.source, MfuSource::Told);
        // 1e17 FLOPs at half of 989e12 a second, and half a minute.
        let hours = gpu.run_hours(&plan.runs[0]);
        assert!((3600.0 * hours - 30.0 - 202.22).abs() < 0.01, "{hours}");
        let jobs: Vec<Job> = all_jobs(&plan).collect();
        let all = gpu.hours(&plan, &jobs);
        assert!((all - hours * plan.runs.len() as f64).abs() < 1e-9, "no other job is counted");
    }

    #[test]
    fn the_mfu_of_the_table_grows_with_the_model() {
        let gpu = gpu(None, &plan("bf16"));
        assert_eq!(gpu.source, MfuSource::Reference);
        assert!((gpu.mfu(27_270_000) - 0.158).abs() < 1e-12);
        // The geometric mean lies halfway in the logarithm.
        assert!((gpu.mfu(306_973) - (0.0012_f64 * 0.0058).sqrt()).abs() < 1e-6);
        assert_eq!((gpu.mfu(3_000_000_000), gpu.mfu(1)), (0.312, 0.000_11));
    }

    /// 8192 tokens a step of ScaMo's 44M took 8.66 ms on an H200 with 1024 codes, and of 343M 55.06 ms.
    #[test]
    fn hours_of_the_table_are_those_that_were_measured() {
        let plan = plan("bf16");
        let h200 = machine::find("h200").unwrap();
        let gpu = Gpu::new(h200, None, &plan, &ResultsFolder::new("/no/such/folder"));
        for (at, measured) in [(0, 8.66), (2, 55.06)] {
            let run = &plan.runs[at];
            assert_eq!(run.spec.batch_tokens, 8192);
            let seconds = 3600.0 * gpu.run_hours(run) - START_S;
            let step_ms = 1e3 * seconds / run.spec.steps as f64;
            assert!((step_ms / measured - 1.0).abs() < 0.04, "{step_ms} ms in place of {measured}");
        }
    }

    #[test]
    fn finished_runs_of_the_card_are_asked_before_what_is_told() {
        let (plan, place) = (plan("bf16"), tempfile::tempdir().unwrap());
        let folder = ResultsFolder::new(place.path());
        let written = |at: usize, device: &str, mfu: f64| {
            let run = &plan.runs[at];
            let mut record: RunRecord =
                serde_json::from_str(include_str!("../../tests/fixtures/record-format-1.json"))
                    .unwrap();
            record.planned.run_id.clone_from(&run.run_id);
            record.planned.budget_flops = run.spec.budget_flops;
            record.measured.wall_s = Some(run.spec.budget_flops / (989e12 * mfu));
            record.measured.device = Some(device.to_string());
            let job = JobId::run(&run.run_id);
            std::fs::create_dir_all(folder.job(&job)).unwrap();
            write_json(&folder.product(&job), &record).unwrap();
        };
        written(0, "NVIDIA L40S", 0.9);
        let gpu = || Gpu::new(machine::find("h100").unwrap(), Some(0.5), &plan, &folder);
        assert_eq!(gpu().source, MfuSource::Told, "another card");
        written(1, "NVIDIA H100 80GB HBM3", 0.2);
        assert_eq!(gpu().source, MfuSource::Measured { runs: 1 });
        let mfu = |at: usize| gpu().mfu(plan.runs[at].params.nonvocab);
        assert!((mfu(1) - 0.2).abs() < 1e-9 && (mfu(2) - 0.2).abs() < 1e-9);
        assert!((0.12..0.13).contains(&mfu(0)), "smaller models reach less: {}", mfu(0));
    }

    /// 29 M parameters take 0.47 GB, 8 layers of 13,107 rows 2.3 GB.
    #[test]
    fn memory_is_that_of_the_formula() {
        let plan = plan("bf16");
        let [small, .., large] = &plan.runs[..] else { panic!("six sizes") };
        let bytes = bytes_on_card(&small.spec);
        assert!((3.5e9..4.5e9).contains(&(bytes as f64)), "{bytes}");
        let bytes = bytes_on_card(&large.spec);
        assert!((85e9..100e9).contains(&(bytes as f64)), "{bytes}");
        let said = too_large(machine::find("h100").unwrap(), &plan.runs).unwrap();
        assert!(said.starts_with("1 of 6 runs do not fit on one h100"), "{said}");
        assert_eq!(too_large(machine::find("h200").unwrap(), &plan.runs), None);
    }
}
