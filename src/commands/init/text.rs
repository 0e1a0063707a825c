//! The sweep file, with comments for whoever changes it.

use std::path::Path;

use super::design::{Design, written};

/// A sweep file.
pub fn text(name: &str, data: Option<&Path>, design: &Design) -> String {
    let data = match data {
        Some(path) => format!(
            "data:\n  source: humanml3d\n  path: {:?}\n  mirror: true      # every training clip left-right too\n",
            path.display().to_string()
        ),
        None => "# The built-in motion; for your own: {source: humanml3d, path: data/mine}\n\
                 data: {source: procedural, clips: auto, val_clips: 64, test_clips: 256}\n"
            .to_string(),
    };
    let list = |values: Vec<String>| values.join(", ");
    let seeds = list(design.seeds.iter().map(u64::to_string).collect());
    let of_tokenizers = match design.tokenizer_seeds[..] {
        [_] => String::new(),
        _ => {
            let seeds = design.tokenizer_seeds.iter().map(u64::to_string).collect();
            format!(", seeds: [{}]", list(seeds))
        }
    };
    let vocab = list(design.vocab.iter().map(usize::to_string).collect());
    let budgets = list(design.budgets.iter().map(|budget| written(*budget)).collect());
    let largest = design.budgets.last().copied().unwrap_or_default();
    let predict = written(10.0 * largest);
    let exclude = match design.exclude.is_empty() {
        true => String::new(),
        false => {
            let lines: String =
                design.exclude.iter().map(|line| format!("    - {line}\n")).collect();
            format!("  # At each budget the sizes near its optimum alone.\n  exclude:\n{lines}")
        }
    };
    let models = design.models();
    format!(
        "# Sized by `isoflop init`. `isoflop plan` prices it, `isoflop run` trains it and fits the laws; every key is in\n\
         # docs/sweep-file.md, and `isoflop schema` gives editors what they check it by.\n\
         name: {name}\n\
         seeds: [{seeds}]      # more seeds tell the noise of runs from the curve of the loss\n\
         {data}\
         # Captions as hashed n-grams; t5, clip, bert or llama read local weights.\n\
         text: {{encoder: hashed-ngrams, dim: 64, max_tokens: 32}}\n\
         # A tokenizer a vocabulary; `isoflop tokenizer eval` compares them with k-means.\n\
         tokenizer: {{kind: patch, steps: 800{of_tokenizers}}}\n\
         # autoregressive, scalewise or masked; a list makes it an axis of the grid.\n\
         generator: autoregressive\n\
         grid:\n  # One depth and sizes a factor of 1.6 apart at most: a gap or a change of depth puts a minimum in doubt.\n  \
         models:\n{models}  vocab: [{vocab}]\n  budgets: [{budgets}]\n{exclude}\
         train:\n  schedule: {{kind: wsd, warmup: 0.1}}\n\
         fit: {{minima: [parabola, argmin, cubic, surface], hold_out: largest-budget, bootstrap: 1000}}\n\
         # Ten times beyond the fit; `isoflop validate RESULTS --budget {predict}` tests it.\n\
         predict: {{budgets: [{predict}]}}\n"
    )
}
