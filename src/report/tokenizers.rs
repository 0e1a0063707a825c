//! The tokenizers beside k-means.

use maud::Markup;

use super::input;
use super::table::table;
use crate::tokenizer::TokenizerMetrics;

/// The table; `None` where the study has no tokenizer.
pub fn section(tokenizers: &[TokenizerMetrics]) -> Option<Markup> {
    let head = [
        "V",
        "kind",
        "seed",
        "MPJPE, mm",
        "heading given",
        "k-means so",
        "codes used",
        "effective codes",
    ];
    let rows: Vec<Vec<String>> = tokenizers.iter().map(row).collect();
    let caption = "Error of the joints on the test split, beside k-means of as many codes";
    let table = table(caption, &head, &rows);
    (!rows.is_empty()).then(|| input::section("tokenizers", "Tokenizers", &table))
}

fn row(metrics: &TokenizerMetrics) -> Vec<String> {
    let mm = |value: Option<f64>| value.map(|mm| format!("{mm:.1}")).unwrap_or_default();
    let architecture = metrics.architecture.as_deref().unwrap_or_default();
    vec![
        metrics.n_vocab.to_string(),
        format!("{architecture} {}", metrics.kind).trim().to_string(),
        metrics.seed.map(|seed| seed.to_string()).unwrap_or_default(),
        mm(Some(metrics.mpjpe_mm)),
        mm(metrics.mpjpe_heading_mm),
        mm(metrics.k_means.as_ref().map(|baseline| baseline.mpjpe_heading_mm)),
        format!("{:.0} %", 100.0 * metrics.utilisation),
        format!("{:.0}", metrics.exponential_entropy),
    ]
}
