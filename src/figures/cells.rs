//! The runs of a sweep grouped for figures, cells of model × vocabulary × budget; and the input of all figures.

use super::axis::count;
use super::scene::{Point, Scene};
use crate::codes::TokenizerMetrics;
use crate::files::FileError;
use crate::laws::{Laws, Parameters};
use crate::record::{Planned, RunRecord, of_largest_share};
use crate::spec::FlopsRule;
use std::collections::BTreeMap;
use thiserror::Error;

/// A model's shape, if known; models are ordered by size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ModelSize {
    pub params_nonvocab: usize,
    pub n_layer: Option<usize>,
    pub n_head: Option<usize>,
    pub d_model: Option<usize>,
    pub d_ff: Option<usize>,
}

impl ModelSize {
    fn of(run: &RunRecord) -> ModelSize {
        let Planned { params_nonvocab, n_layer, n_head, d_model, d_ff, .. } = run.planned;
        ModelSize { params_nonvocab, n_layer, n_head, d_model, d_ff }
    }

    /// Size, layers, heads, width: `790k (4L 4H 128d)`.
    pub fn label(&self) -> String {
        let known = [(self.n_layer, 'L'), (self.n_head, 'H'), (self.d_model, 'd')];
        let known = known.into_iter().filter_map(|(n, unit)| Some(format!("{}{unit}", n?)));
        let (size, shape) = (count(self.params_nonvocab as f64), known.collect::<Vec<_>>());
        if shape.is_empty() { size } else { format!("{size} ({})", shape.join(" ")) }
    }
}

/// A run that has a place on the figures.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    run: &'a RunRecord,
    loss_normalised: f64,
    /// Spent, under the rule of the figure.
    flops: f64,
}

impl<'a> Shown<'a> {
    /// Requires a finite L_u, and FLOPs by a rule; the error names what is missing.
    pub fn of(run: &'a RunRecord, rule: FlopsRule) -> Result<Self, String> {
        let loss_normalised = run.loss_normalised().map_err(|lacking| lacking.to_string())?;
        let flops = run.flops(rule).map_err(|lacking| lacking.to_string())?;
        match loss_normalised.is_finite() {
            true => Ok(Shown { run, loss_normalised, flops }),
            false => Err(format!("its normalised loss is {loss_normalised}")),
        }
    }
}

/// The runs of one model, vocabulary and budget, averaged over seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct CellMean {
    pub model: ModelSize,
    pub n_vocab: usize,
    pub budget_flops: f64,
    /// Spent, under the rule of the figure.
    pub flops: f64,
    /// L_u, in nats.
    pub loss_normalised: f64,
    /// Standard error of the mean over the seeds; `None` for one seed.
    pub standard_error: Option<f64>,
    pub seeds: usize,
}

impl CellMean {
    /// Its loss against its FLOPs.
    pub fn at_its_flops(&self) -> Point {
        (self.flops, self.loss_normalised)
    }

    /// Its loss against its N_nv.
    pub fn at_its_size(&self) -> Point {
        (self.model.params_nonvocab as f64, self.loss_normalised)
    }

    /// Its loss against its V.
    pub fn at_its_vocab(&self) -> Point {
        (self.n_vocab as f64, self.loss_normalised)
    }
}

/// Every cell of a sweep, with the sorted values of each axis of the grid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    pub cells: Vec<CellMean>,
    pub models: Vec<ModelSize>,
    pub vocabs: Vec<usize>,
    pub budgets: Vec<f64>,
}

impl Cells {
    /// Groups the runs for figures: those of the largest share of the data, with FLOPs counted by `rule`.
    pub fn of(records: &[RunRecord], rule: FlopsRule) -> Cells {
        let mut groups: BTreeMap<_, Vec<Shown>> = BTreeMap::new();
        for shown in of_largest_share(records).filter_map(|run| Shown::of(run, rule).ok()) {
            let Planned { n_vocab, budget_flops, .. } = shown.run.planned;
            let key = (ModelSize::of(shown.run), n_vocab, budget_flops.to_bits());
            groups.entry(key).or_default().push(shown);
        }
        let cells: Vec<_> = groups.into_values().map(|runs| cell(&runs)).collect();
        let models = sorted(cells.iter().map(|cell| cell.model));
        let vocabs = sorted(cells.iter().map(|cell| cell.n_vocab));
        // The bits of positive numbers sort as the numbers do.
        let budgets = sorted(cells.iter().map(|cell| cell.budget_flops.to_bits()));
        let budgets = budgets.into_iter().map(f64::from_bits).collect();
        Cells { cells, models, vocabs, budgets }
    }

    /// The best cell of each budget, by budget: the lower envelope.
    pub fn envelope(&self) -> Vec<&CellMean> {
        let best = |&budget: &f64| best(self.cells.iter().filter(|c| c.budget_flops == budget));
        self.budgets.iter().filter_map(best).collect()
    }

    /// At one budget, the best vocabulary of each model, by size.
    pub fn best_of_models(&self, budget: f64) -> Vec<&CellMean> {
        let of = |model: &ModelSize| {
            best(self.cells.iter().filter(|c| c.budget_flops == budget && c.model == *model))
        };
        self.models.iter().filter_map(of).collect()
    }

    pub fn losses(&self) -> impl Iterator<Item = f64> {
        self.cells.iter().map(|cell| cell.loss_normalised)
    }

    /// How the points came about, for a figure's remarks, with a bar at each point or without.
    pub fn seeds_remark(&self, has_bars: bool) -> &'static str {
        match self.cells.iter().any(|cell| cell.seeds > 1) {
            true if has_bars => "Points are means over seeds, bars one standard error.",
            true => "Points are means over seeds.",
            false => "One point a run.",
        }
    }
}

fn cell(runs: &[Shown]) -> CellMean {
    let n = runs.len() as f64;
    let mean = |of: fn(&Shown) -> f64| runs.iter().map(of).sum::<f64>() / n;
    let loss = mean(|run| run.loss_normalised);
    let squares: f64 = runs.iter().map(|run| (run.loss_normalised - loss).powi(2)).sum();
    let first = runs[0].run;
    CellMean {
        model: ModelSize::of(first),
        n_vocab: first.planned.n_vocab,
        budget_flops: first.planned.budget_flops,
        flops: mean(|run| run.flops),
        loss_normalised: loss,
        standard_error: (runs.len() > 1).then(|| (squares / (n * (n - 1.0))).sqrt()),
        seeds: runs.len(),
    }
}

fn best<'a>(cells: impl Iterator<Item = &'a CellMean>) -> Option<&'a CellMean> {
    cells.min_by(|a, b| a.loss_normalised.total_cmp(&b.loss_normalised))
}

/// Each value once, ascending.
pub fn sorted<T: Ord>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut values: Vec<_> = values.collect();
    values.sort_unstable();
    values.dedup();
    values
}

// The input of a sweep's figures, and the names of the loss and of the model's size, which differ between a sweep and
// another table.

/// The input of a sweep's figures.
#[derive(Clone, Copy, Debug)]
pub struct FigureInput<'a> {
    /// The sweep's name, at the head of each figure.
    pub title: &'a str,
    /// The name of the loss, if it is not L_u: the column or expression of a table.
    pub loss_name: Option<&'a str>,
    pub records: &'a [RunRecord],
    pub laws: Option<&'a Laws>,
    pub tokenizers: &'a [TokenizerMetrics],
}

/// Why figures could not be written.
#[derive(Debug, Error)]
pub enum FigureError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("cannot draw the figure {name}: {message}")]
    Draw { name: String, message: String },
    #[error(
        "the laws count FLOPs by {rule:?}, which no run records; \
         fit them again with --flops openai, 6nd or exact"
    )]
    UnknownRule { rule: String },
}

/// A page, or the reason why there is none.
pub type Drawing = Result<Scene, String>;

/// The source of a figure: the input, and its runs in cells.
pub struct Sources<'a> {
    pub input: &'a FigureInput<'a>,
    pub cells: Cells,
    /// The rule by which `cells` count FLOPs.
    pub rule: FlopsRule,
}

impl<'a> Sources<'a> {
    /// Counts FLOPs by the rule of the laws; without laws by one that the runs are counted by.
    pub fn of(input: &'a FigureInput<'a>) -> Result<Sources<'a>, FigureError> {
        let rule = match input.laws {
            None => counted(input.records),
            Some(Laws { flops_rule: rule, .. }) => FlopsRule::named(rule)
                .ok_or_else(|| FigureError::UnknownRule { rule: rule.clone() })?,
        };
        Ok(Sources { input, cells: Cells::of(input.records, rule), rule })
    }

    /// The figure's title after the sweep's.
    pub fn title(&self, figure: &str) -> String {
        format!("{}: {figure}", self.input.title)
    }

    pub fn laws(&self) -> Result<&'a Laws, String> {
        self.input.laws.ok_or_else(|| "there are no laws".to_owned())
    }

    pub fn held_out_budget(&self) -> Option<f64> {
        self.input.laws?.held_out.as_ref().map(|held_out| held_out.budget_flops)
    }

    /// The axis of the loss.
    pub fn loss_axis(&self) -> String {
        match self.input.loss_name {
            None => "Normalised loss Lᵤ (nats)".to_owned(),
            Some("loss") => "Loss".to_owned(),
            Some(name) => format!("Loss: {name}"),
        }
    }

    /// The symbol of the loss, and its unit after a number.
    pub fn loss_symbol(&self) -> [&'static str; 2] {
        if self.input.loss_name.is_none() { ["Lᵤ", " nats"] } else { ["L", ""] }
    }

    /// Whether the vocabulary's parameters are not separate.
    pub fn knows_size_alone(&self) -> bool {
        match self.input.laws {
            Some(laws) => laws.parameters == Parameters::Total,
            None => self.input.records.iter().all(|run| run.planned.params_vocab == 0),
        }
    }

    /// An error if there is no vocabulary to show.
    pub fn needs_vocabulary(&self) -> Result<(), String> {
        let is_known = !self.knows_size_alone() || self.input.loss_name.is_none();
        is_known.then_some(()).ok_or("the vocabulary's parameters are not told apart".to_owned())
    }

    /// The symbol of a model's size.
    pub fn size_symbol(&self) -> &'static str {
        if self.knows_size_alone() { "N" } else { "Nₙᵥ" }
    }
}

/// The default rule of a sweep, or the only rule of a table.
fn counted(records: &[RunRecord]) -> FlopsRule {
    let usual = FlopsRule::default();
    let others = [FlopsRule::SixNd, FlopsRule::OpenAi, FlopsRule::Exact];
    let has = |rule: &FlopsRule| records.iter().any(|run| run.flops(*rule).is_ok());
    [usual].into_iter().chain(others).find(has).unwrap_or(usual)
}

/// An error if there are more `things` than a legend can list.
pub fn few_enough(count: usize, things: &str) -> Result<(), String> {
    let is_few = count <= 100;
    is_few.then_some(()).ok_or_else(|| format!("{count} {things} are too many to tell apart"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::tests::simulated;
    use crate::record::facts::LOSS_NORMALISED;

    #[test]
    fn seeds_of_a_cell_are_averaged() {
        let mut runs = vec![simulated::sweep().records[0].clone(); 3];
        for (run, loss) in runs.iter_mut().zip([-1.0, -2.0, -3.0]) {
            run.metrics.set(LOSS_NORMALISED, loss);
        }
        let cells = Cells::of(&runs, FlopsRule::Exact);
        assert_eq!(cells.cells.len(), 1);
        assert_eq!((cells.cells[0].loss_normalised, cells.cells[0].seeds), (-2.0, 3));
    }

    #[test]
    fn a_run_without_the_figures_count_of_flops_is_left_out_and_one_without_a_shape_is_not() {
        let mut runs = simulated::sweep().records;
        runs.truncate(2);
        runs[0].measured.flops_exact = None;
        runs[1].planned.n_head = None;
        let reason = Shown::of(&runs[0], FlopsRule::Exact).unwrap_err();
        assert_eq!(reason, "its record has no flops_exact");
        let cells = Cells::of(&runs, FlopsRule::Exact);
        assert_eq!((cells.cells.len(), cells.cells[0].seeds), (1, 1));
        assert_eq!(cells.models[0].label(), "24.7k (2L 32d)");
    }

    #[test]
    fn the_envelope_is_never_above_a_run_of_its_budget() {
        let cells = Cells::of(&simulated::sweep().records, FlopsRule::OpenAi);
        let envelope = cells.envelope();
        assert_eq!(envelope.len(), cells.budgets.len());
        for cell in &cells.cells {
            let best = envelope.iter().find(|best| best.budget_flops == cell.budget_flops).unwrap();
            assert!(best.loss_normalised <= cell.loss_normalised);
        }
    }
}
