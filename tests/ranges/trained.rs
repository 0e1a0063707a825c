//! Every number at the low bound of its range: trained, as many in a file as go together.

use std::collections::BTreeSet;
use std::process::Command;

use super::*;

/// One run of some hundred steps of one token, after one step of its tokenizer.
const SMALL: &str = "{name: t, data: {clips: 8, val_clips: 2, test_clips: 2}, text: {dim: 8}, fit: {bootstrap: 2}, \
                     grid: {models: [{n_layer: 1, n_head: 1, d_model: 2}], vocab: [16], budgets: [1e6]}, \
                     model: {motion_slots: 256}, train: {min_steps: 1, batch: 1}, tokenizer: {steps: 1, batch: 2, window: 32}}";

/// Sections over [`SMALL`]: between them the tokenizers, quantizers, generators and evaluators.
const LAYERS: [&str; 12] = [
    "{tokenizer: {kind: fsq, plateau: {evaluations: 1}}, train: {batch: {min: 1}}}",
    "{tokenizer: {kind: vq}, train: {schedule: {kind: cosine}}, flops: {rule: exact}}",
    "{tokenizer: {kind: patch}, train: {schedule: {share: true}}, data: {test_clips: 64},
      evaluator: {steps: 1, evaluations: 1}}",
    "{tokenizer: {kind: patch, codes: fixed, loss: features}}",
    "{generator: masked, tokenizer: {kind: patch, quantizer: {kind: residual}}, data: {test_clips: 64},
      evaluator: {kind: matching, steps: 1, evaluations: 1}}",
    "{generator: [scalewise, autoregressive], model: {motion_slots: 8}, grid: {budgets: [1e5]},
      tokenizer: {kind: patch, quantizer: {kind: multiscale, scales: [1, 2]}}}",
    "{generator: scalewise, model: {motion_slots: 8}, grid: {budgets: [1e5]},
      tokenizer: {kind: convolutional, quantizer: {kind: multiscale, inner: fsq, scales: [1, 2]}}}",
    "{tokenizer: {kind: transformer, language: {}}, data: {test_clips: 64},
      evaluator: {kind: matching, mismatches: shifted, steps: 1, evaluations: 1}}",
    "{generator: masked, tokenizer: {kind: transformer, quantizer: {kind: residual, inner: fsq}}}",
    "{scores: {repeats: 1, multimodal_captions: 1, multimodal_motions: 2}, sampling: {}}",
    "{scores: {}, generator: masked}",
    "{tokenizer: {kind: transformer, latents: 1, quantizer: {kind: multiscale, scales: [1]}}}",
];

/// An evaluator that passes its gates, and a rate at which no run diverges, under the layers whose runs are scored.
const SCORED: &str = "{train: {lr: 1e-3}, data: {clips: 512, val_clips: 32, test_clips: 192}, text: {dim: 16, max_tokens: 12},
    evaluator: {width: 32, layers: 1, heads: 2, dim: 16, steps: 150, warmup_steps: 20, lr: 5e-3, evaluations: 5}}";

/// Whether something else than its range bounds a number in a layer: an evaluator contrasts clips with each other, and
/// a long clip has many codes, unless the quantizer makes as many of each clip. Where runs are scored, numbers of scores
/// or of sampling alone are lowered, and where the rule of a batch is, no number takes its place.
fn is_kept(layer: &str, name: &str) -> bool {
    let evaluated = layer.contains("evaluator");
    match name.split_once('.') {
        Some(("scores", _)) => layer.contains("sampling") || !layer.contains("scores"),
        Some(("sampling", _)) => !layer.contains("sampling"),
        _ if layer.contains("scores") => true,
        Some(("train", "batch")) => layer.contains("batch"),
        Some(("data", "clips" | "val_clips" | "test_clips")) => evaluated,
        Some(("model", "motion_slots")) => !layer.contains("multiscale"),
        Some(("evaluator", _)) => !evaluated,
        _ => false,
    }
}

/// No run is trained by them here: numbers of engines, of other programs and of files, and a budget too small for a step.
fn is_untrained(name: &str) -> bool {
    let of = ["engine.", "trainer.", "data.fps", "data.union.", "grid.also.", "grid.budgets"];
    of.iter().any(|start| name.starts_with(start))
}

/// Two betas, where any other list has one number.
const BETAS: &str = "train.betas";

impl Number {
    /// Sets it to its low bound.
    fn lower(&self, file: &mut Value) {
        let low = self.bounds[0];
        let low = if self.is_whole { json!(low as u64) } else { json!(low) };
        put(file, &self.path, &low);
        if self.name() == BETAS {
            file["train"]["betas"] = json!([low, low]);
        }
    }

    fn is_low(&self, file: &Value) -> bool {
        let step = |at: &'_ Value, step: &Step| match step {
            Step::Key(key, _) => at[key].clone(),
            Step::Entry => at[0].clone(),
        };
        self.path.iter().fold(file.clone(), |at, of| step(&at, of)).as_f64() == Some(self.bounds[0])
    }
}

/// The file with those numbers at their low bounds, one after another, with which it still plans a run; and they.
fn lowest<'n>(layer: &str, numbers: &[&'n Number]) -> (Value, Vec<&'n Number>) {
    let mut file = yaml(SMALL);
    if layer.contains("scores") {
        laid(&mut file, yaml(SCORED));
    }
    laid(&mut file, yaml(layer));
    // Facts of the data take longest; numbers of the data hardly change them.
    let parsed = |file: &Value| sweep::parse("t.yaml", &file.to_string(), &[]);
    let facts = planned(&parsed(&file).expect("a sound file")).data;
    let has_runs = |sweep: Sweep| !Plan::new(&sweep, facts.clone()).runs.is_empty();
    for number in numbers {
        let name = number.name();
        if is_untrained(&name) || is_kept(layer, &name) {
            continue;
        }
        let mut next = file.clone();
        number.lower(&mut next);
        if parsed(&next).is_ok_and(has_runs) {
            file = next;
        }
    }
    // One way to write a section may have taken the place of another.
    let low = numbers.iter().copied().filter(|number| number.is_low(&file)).collect();
    (file, low)
}

/// Trains a sweep.
///
/// # Errors
/// A job fails: what the program prints.
fn train(file: &Value) -> Result<(), String> {
    let place = tempfile::tempdir().expect("a temporary folder");
    let path = place.path().join("t.yaml");
    std::fs::write(&path, file.to_string()).expect("a writable folder");
    let mut program = Command::new(env!("CARGO_BIN_EXE_isoflop"));
    program.arg("run").arg(&path).arg("--out").arg(place.path()).args(["--jobs", "1", "--quiet"]);
    let ended = program.output().expect("the program starts");
    let said = String::from_utf8_lossy(&ended.stderr).into_owned();
    if ended.status.success() && !said.contains("failed") { Ok(()) } else { Err(said) }
}

/// The numbers whose low bound a failure needs: with any one of them left out, the file trains.
fn culprits(layer: &str, low: &[&Number]) -> Vec<String> {
    let is_culprit = |number: &&&Number| {
        let others = low.iter().copied().filter(|other| other.name() != number.name());
        train(&lowest(layer, &others.collect::<Vec<_>>()).0).is_ok()
    };
    low.iter().filter(is_culprit).map(|number| number.name()).collect()
}

#[test]
fn every_number_trains_at_its_low_bound() {
    let all = all_numbers();
    let of_layer = |(i, layer): (usize, &&str)| {
        let mut numbers: Vec<&Number> = all.iter().collect();
        // Where a section can be written in two ways, the last one stays.
        if i % 2 == 1 {
            numbers.reverse();
        }
        let (file, low) = lowest(layer, &numbers);
        if let Err(said) = train(&file) {
            eprintln!("{file}\n{said}\nwhich numbers it needs is looked for");
            let culprits = culprits(layer, &low);
            panic!("fails at the low bounds of {culprits:?}: {said}");
        }
        low.iter().map(|number| number.name()).collect::<Vec<_>>()
    };
    let trained: BTreeSet<String> = LAYERS.par_iter().enumerate().flat_map_iter(of_layer).collect();
    let names = all.iter().map(Number::name).filter(|name| !is_untrained(name));
    let missed: Vec<String> = names.filter(|name| !trained.contains(name)).collect();
    assert_eq!(missed, Vec::<String>::new(), "no file trains with them at their low bounds");
}
