//! [`ReportInput`]: all that a page shows, and of it a [`Study`] for each generator.

use maud::{Markup, html};

use crate::laws::Laws;
use crate::motion::Pose;
use crate::predict::Prediction;
use crate::record::RunRecord;
use crate::tokenizer::TokenizerMetrics;

/// All that a page shows.
pub struct ReportInput<'a> {
    pub name: &'a str,
    /// One for each generator.
    pub studies: &'a [Study<'a>],
    pub samples: &'a [Sample],
    pub tokenizers: &'a [TokenizerMetrics],
    /// Those of all generators together.
    pub figures: &'a [Figure],
    /// The resolved sweep, in YAML; empty for a table made elsewhere.
    pub sweep: &'a str,
    /// Cells that were not run, each with its reason.
    pub dropped: &'a [String],
}

/// The runs of one generator, and what they bear.
pub struct Study<'a> {
    /// The generator's name; `None` where the sweep has one alone.
    pub generator: Option<&'a str>,
    /// What the loss is called, if it is not L_u: the column or expression of a table.
    pub loss_name: Option<&'a str>,
    /// What `isoflop run` says at its end.
    pub verdict: &'a str,
    /// Absent where the runs bear none.
    pub laws: Option<&'a Laws>,
    /// By rising budgets: what the slider moves over.
    pub predictions: &'a [Prediction],
    pub records: &'a [RunRecord],
    pub figures: &'a [Figure],
}

impl ReportInput<'_> {
    /// The runs of all generators.
    pub(super) fn records(&self) -> Vec<&RunRecord> {
        self.studies.iter().flat_map(|study| study.records).collect()
    }
}

impl Study<'_> {
    /// An id of the page that no other generator has.
    pub(super) fn id(&self, name: &str) -> String {
        self.generator.map_or_else(|| name.to_string(), |generator| format!("{generator}-{name}"))
    }

    /// Words on the page that no other generator has.
    pub(super) fn own(&self, text: &str) -> String {
        self.generator.map_or_else(|| text.to_string(), |generator| format!("{text}, {generator}"))
    }

    /// A section of the page that no other generator has.
    pub(super) fn section(&self, name: &str, heading: &str, within: &Markup) -> Markup {
        section(&self.id(name), &self.own(heading), within)
    }
}

/// A section of the page with its heading.
pub(super) fn section(id: &str, heading: &str, within: &Markup) -> Markup {
    html! { section aria-labelledby=(id) { h2 id=(id) { (heading) } (within) } }
}

/// A figure of the sweep's folder.
pub struct Figure {
    pub name: String,
    pub svg: String,
}

/// A motion of the study.
pub struct Sample {
    pub caption: String,
    /// The run that made it.
    pub run_id: String,
    pub fps: f64,
    /// Metres.
    pub poses: Vec<Pose>,
    /// The true motion of that caption, where the data are at hand.
    pub truth: Option<Vec<Pose>>,
}
