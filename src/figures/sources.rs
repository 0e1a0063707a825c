//! The input of a sweep's figures, and the names of the loss and of the model's size, which differ between a sweep and
//! another table.

use thiserror::Error;

use super::cells::Cells;
use super::scene::Scene;
use crate::codes::TokenizerMetrics;
use crate::files::FileError;
use crate::laws::{Laws, Parameters};
use crate::record::RunRecord;
use crate::spec::FlopsRule;

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
