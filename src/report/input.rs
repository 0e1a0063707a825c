//! [`ReportInput`]: the contents of a page, with a [`Study`] for each generator: its runs, and the names of its
//! quantities.

use maud::{Markup, PreEscaped, html};
use serde_json::Value;

use super::figure::Figure;
use crate::codes::TokenizerMetrics;
use crate::laws::text::count;
use crate::laws::{Laws, Parameters};
use crate::motion::Pose;
use crate::predict::Prediction;
use crate::record::{RunRecord, of_largest_share};

/// The contents of a page.
pub struct ReportInput<'a> {
    pub name: &'a str,
    /// One for each generator.
    pub studies: &'a [Study<'a>],
    /// A paragraph at the head of the page.
    pub note: Option<&'a str>,
    pub samples: &'a [Sample],
    /// Motions that cannot be shown, a sentence each.
    pub not_shown: &'a [String],
    pub tokenizers: &'a [TokenizerMetrics],
    /// The figures of all generators together.
    pub figures: &'a [Figure],
    /// The resolved sweep, in YAML; empty for a table made elsewhere.
    pub sweep: &'a str,
    /// Cells that were not run, each with its reason.
    pub dropped: &'a [String],
}

/// The runs of one generator, and their laws.
pub struct Study<'a> {
    /// The generator's name; `None` if the sweep has only one.
    pub generator: Option<&'a str>,
    /// The name of the loss, if it is not L_u: the column or expression of a table.
    pub loss_name: Option<&'a str>,
    /// The final text of `isoflop run`.
    pub verdict: &'a str,
    /// `None` if no laws could be fitted.
    pub laws: Option<&'a Laws>,
    /// The steps of the slider, by rising budgets.
    pub predictions: &'a [Prediction],
    pub records: &'a [RunRecord],
    pub figures: &'a [Figure],
}

/// The motions of a caption.
pub struct Sample {
    pub caption: String,
    /// The run that made them.
    pub run_id: String,
    pub fps: f64,
    /// Motions that the run made, in metres.
    pub made: Vec<Vec<Pose>>,
    /// The true motion of that caption, if the data are at hand.
    pub truth: Option<TrueMotion>,
    /// The true motion from its codes, if the run's tokenizer is at hand.
    pub reconstruction: Option<Vec<Pose>>,
}

/// A clip of the data.
pub struct TrueMotion {
    /// Metres.
    pub poses: Vec<Pose>,
    /// The clip's name, and the licence of its data set if the sweep tells it.
    pub source: String,
}

impl ReportInput<'_> {
    /// The runs of all generators.
    pub(super) fn records(&self) -> Vec<&RunRecord> {
        self.studies.iter().flat_map(|study| study.records).collect()
    }
}

impl Study<'_> {
    /// An id on the page, unique to the generator.
    pub(super) fn id(&self, name: &str) -> String {
        self.generator.map_or_else(|| name.to_string(), |generator| format!("{generator}-{name}"))
    }

    /// Text on the page, unique to the generator.
    pub(super) fn own(&self, text: &str) -> String {
        self.generator.map_or_else(|| text.to_string(), |generator| format!("{text}, {generator}"))
    }

    /// A section of the page, unique to the generator.
    pub(super) fn section(&self, name: &str, heading: &str, within: &Markup) -> Markup {
        section(&self.id(name), &self.own(heading), within)
    }

    /// The names of its quantities.
    pub(super) fn words(&self) -> Words {
        let total = self.laws.is_some_and(|laws| laws.parameters == Parameters::Total);
        let has_vocab = !total && self.records.iter().any(|run| run.planned.n_vocab > 0);
        let size = match self.laws {
            Some(_) if total => "N",
            None if !has_vocab && !self.records.is_empty() => "N",
            _ => "N_nv",
        };
        let (loss, loss_axis) = self.loss_name.map_or(("L_u", "L_u, nats"), |name| ("loss", name));
        Words { size, loss, loss_axis: loss_axis.to_string(), has_vocab }
    }
}

/// A section of the page with its heading.
pub(super) fn section(id: &str, heading: &str, within: &Markup) -> Markup {
    html! { section aria-labelledby=(id) { h2 id=(id) { (heading) } (within) } }
}

/// JSON that cannot end a script element.
pub(super) fn json_text(data: &Value) -> PreEscaped<String> {
    PreEscaped(data.to_string().replace('<', "\\u003c"))
}

/// The names of the loss and of the model's size: they differ between a sweep and another table.
pub(super) struct Words {
    /// The size of a model: N_nv, or N if the vocabulary's parameters are not counted separately.
    pub size: &'static str,
    /// The loss in a sentence.
    pub loss: &'static str,
    /// The loss with its unit, at an axis.
    pub loss_axis: String,
    /// Whether models have a vocabulary.
    pub has_vocab: bool,
}

/// The runs of a study in a sentence.
pub(super) fn extent(records: &[&RunRecord]) -> String {
    let budgets = budgets(records.iter().copied());
    let span = match budgets[..] {
        [] => String::new(),
        [only] => format!(" at {} FLOPs", count(only)),
        [first, .., last] => format!(" at {} to {} FLOPs", count(first), count(last)),
    };
    let seconds: f64 = records.iter().filter_map(|record| record.measured.wall_s).sum();
    // A table made elsewhere has no times.
    let hours =
        if seconds > 0.0 { format!(", {:.1} core-hours", seconds / 3600.0) } else { String::new() };
    let plural = if records.len() == 1 { "" } else { "s" };
    format!("{} run{plural}{span}{hours}", records.len())
}

/// The budgets of runs, ascending.
pub(super) fn budgets<'a>(records: impl IntoIterator<Item = &'a RunRecord>) -> Vec<f64> {
    let records = records.into_iter();
    let mut budgets: Vec<f64> = records.map(|record| record.planned.budget_flops).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    budgets
}

/// The runs of a budget on the largest share of the data.
pub(super) fn of_budget(records: &[RunRecord], budget: f64) -> impl Iterator<Item = &RunRecord> {
    of_largest_share(records).filter(move |record| record.planned.budget_flops == budget)
}
