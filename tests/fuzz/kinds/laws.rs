//! `laws.json`: predictions by it, and figures of it.

use std::fs;
use std::path::Path;

use isoflop::figures::{FigureInput, Format, draw_all};
use isoflop::files::read_if_there;
use isoflop::laws::{Laws, scamo};
use isoflop::predict::{ModelSize, PredictOptions, ladder_of, predict, predict_sized};
use isoflop::record::table;
use isoflop::words::fit::{brief, summary};
use isoflop::words::prediction::{said, sized_text};
use serde_json::Value;

use super::{bytes_of, first_lines, words};
use crate::harness::Kind;
use crate::mutate;

pub const LAWS: Kind = Kind {
    name: "laws",
    file: "laws.json",
    seeds: small_laws,
    mutate: mutate::text,
    read: predicted,
};
pub const FIGURES: Kind = Kind {
    name: "figures",
    file: "laws.json",
    seeds: small_laws,
    mutate: mutate::text,
    read: drawn,
};

/// Replicates of a bootstrap, and items of any list, that are kept: inputs are small.
const KEPT: usize = 3;

fn small_laws(place: &Path) -> Vec<Vec<u8>> {
    fs::write(place.join("runs.csv"), first_lines("results/cmu-motion/runs.csv", 60))
        .expect("a writable folder");
    let files = ["cmu-motion", "motion-shares", "width-law"];
    let small = |name: &&str| {
        let mut laws: Value =
            serde_json::from_slice(&bytes_of(&format!("results/{name}/laws.json"))).expect("JSON");
        shorten(&mut laws);
        serde_json::to_vec_pretty(&laws).expect("plain values")
    };
    let published = serde_json::to_vec_pretty(&scamo()).expect("plain values");
    files.iter().map(small).chain([published]).collect()
}

/// Numbers of the longest list of coefficients.
const MOST_COEFFICIENTS: usize = 24;

fn shorten(value: &mut Value) {
    match value {
        Value::Array(items) => {
            // Coefficients stay.
            let is_list = items.len() > MOST_COEFFICIENTS || items.iter().any(Value::is_object);
            items.truncate(if is_list { KEPT } else { MOST_COEFFICIENTS });
            items.iter_mut().for_each(shorten);
        }
        Value::Object(entries) => entries.values_mut().for_each(shorten),
        _ => {}
    }
}

fn laws(path: &Path) -> Result<Laws, String> {
    Ok(read_if_there(path).map_err(words)?.expect("just written"))
}

fn predicted(path: &Path) -> Result<(), String> {
    let laws = laws(path)?;
    let shapes = ladder_of(&laws);
    let options = PredictOptions { shapes: &shapes, ..PredictOptions::default() };
    let mut predictions = Vec::new();
    let mut refused = None;
    for budget in [1e9, 1e12, 1e18, 1e25] {
        match predict(&laws, budget, &options) {
            Ok(prediction) => predictions.push(prediction),
            Err(error) => refused = Some(words(error)),
        }
    }
    let model = ModelSize { params: 1e6, n_vocab: None, params_vocab: None, tokens: 1e8 };
    if let Ok(sized) = predict_sized(&laws, &model) {
        assert!(!sized_text(&sized).is_empty());
    }
    assert!(!brief(&laws).is_empty() && !summary(&laws).is_empty());
    let _ = [true, false].map(|full| said(&predictions, full));
    // A budget far from the runs may be refused.
    refused.filter(|_| predictions.is_empty()).map_or(Ok(()), Err)
}

fn drawn(path: &Path) -> Result<(), String> {
    let laws = laws(path)?;
    let folder = path.parent().expect("a folder");
    let records = table::read(folder).map_err(words)?;
    let input = FigureInput {
        title: &laws.name,
        loss_name: None,
        records: &records,
        laws: Some(&laws),
        tokenizers: &[],
    };
    draw_all(&input, &folder.join("figures"), |_| true, &[Format::Svg]).map_err(words)?;
    Ok(())
}
