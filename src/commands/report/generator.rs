//! The results of one generator of a sweep, for its page.

use std::path::Path;

use anyhow::Result;
use isoflop::files::read_if_there;
use isoflop::jobs::ResultsFolder;
use isoflop::laws::Laws;
use isoflop::predict::Prediction;
use isoflop::record::{RunRecord, Tuned};
use isoflop::report::{Figure, Study};

use super::kept;
use crate::commands::by_generator::parted;
use crate::commands::{fit, predict};

/// The slider ends at so many times the largest budget that laws were fitted to.
const FARTHEST: f64 = 1000.0;

/// Budgets of a decade: rounded, ten of about the same ratio.
const STEPS: [f64; 10] = [1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.3, 8.0];

/// The runs of one generator, and what its folder says of them.
pub struct GeneratorResults {
    generator: Option<String>,
    /// What the loss is called, if it is not L_u.
    pub loss_name: Option<String>,
    verdict: String,
    laws: Option<Laws>,
    predictions: Vec<Prediction>,
    records: Vec<RunRecord>,
    figures: Vec<Figure>,
}

impl GeneratorResults {
    /// Runs that bear `laws`, or none, with predictions for the slider and for the budgets that were `told`.
    pub fn new(
        laws: Option<Laws>,
        told: &[Prediction],
        records: Vec<RunRecord>,
        figures: &Path,
    ) -> Result<Self> {
        let verdict = laws.as_ref().map_or_else(
            || "The runs bear no laws; `isoflop fit` says why.".to_string(),
            |laws| fit::text(laws, &[], false),
        );
        let predictions = laws.as_ref().map(|laws| along(laws, told)).unwrap_or_default();
        let (generator, loss_name, figures) = (None, None, kept::figures(figures)?);
        Ok(Self { generator, loss_name, verdict, laws, predictions, records, figures })
    }

    fn read(
        folder: &ResultsFolder,
        generator: Option<String>,
        records: &[RunRecord],
    ) -> Result<Self> {
        let laws: Option<Laws> = read_if_there(&folder.file("laws.json"))?;
        let told: Option<Vec<Prediction>> = read_if_there(&folder.file("prediction.json"))?;
        let (told, records) = (told.unwrap_or_default(), Tuned::of(records).records);
        Ok(Self { generator, ..Self::new(laws, &told, records, &folder.file("figures"))? })
    }

    /// What the page shows of it.
    pub fn study(&self) -> Study<'_> {
        Study {
            generator: self.generator.as_deref(),
            loss_name: self.loss_name.as_deref(),
            verdict: &self.verdict,
            laws: self.laws.as_ref(),
            predictions: &self.predictions,
            records: &self.records,
            figures: &self.figures,
        }
    }
}

/// One of a sweep with one generator, and else one for each, of its own folder.
pub fn of_each(folder: &ResultsFolder, records: &[RunRecord]) -> Result<Vec<GeneratorResults>> {
    let parted = parted(records);
    if parted.len() < 2 {
        return Ok(vec![GeneratorResults::read(folder, None, records)?]);
    }
    let own = |(name, records): (String, Vec<RunRecord>)| {
        GeneratorResults::read(&folder.of_generator(&name), Some(name), &records)
    };
    parted.into_iter().map(own).collect()
}

/// Predictions for the slider: rounded budgets from the first fitted one on, and those of the sweep.
fn along(laws: &Laws, told: &[Prediction]) -> Vec<Prediction> {
    let [first, last] = laws.range();
    if first >= last {
        return told.to_vec();
    }
    let powers = first.log10().floor() as i32..=(last * FARTHEST).log10().ceil() as i32;
    let rounded = powers.flat_map(|power| STEPS.map(|step| format!("{step}e{power}")));
    let rounded = rounded.filter_map(|budget| budget.parse().ok());
    let within = rounded.filter(|budget| (first..=last * FARTHEST).contains(budget));
    let mut budgets: Vec<f64> =
        within.chain(told.iter().map(|prediction| prediction.budget_flops)).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets.into_iter().filter_map(|budget| predict::predict_one(laws, budget).ok()).collect()
}
