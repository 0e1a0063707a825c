//! Records of finished runs, and what of them must not depend on how they came about.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use isoflop::files::digest;
use isoflop::record::{Measured, RunRecord};

/// Every `record.json` of a sweep's folder, by run.
pub fn bytes(results: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(runs) = fs::read_dir(results.join("runs")) else { return BTreeMap::new() };
    let record = |place: &Path| fs::read(place.join("record.json")).ok();
    let runs = runs.map(|run| run.expect("a readable entry").path());
    let name = |place: &Path| place.file_name().expect("a run's id").to_string_lossy().into_owned();
    runs.filter_map(|place| Some((name(&place), record(&place)?))).collect()
}

/// Every record of a sweep's folder, without what a clock or a meter measured.
///
/// Floats are compared by equality: the same bits, or not the same run.
pub fn timeless(results: &Path) -> BTreeMap<String, RunRecord> {
    let read = |bytes: &[u8]| serde_json::from_slice::<RunRecord>(bytes).expect("a whole record");
    bytes(results).iter().map(|(id, bytes)| (id.clone(), without_time(read(bytes)))).collect()
}

fn without_time(mut record: RunRecord) -> RunRecord {
    let Measured { wall_s, tokens_per_s, peak_bytes, .. } = &mut record.measured;
    assert!(wall_s.take().is_some() && tokens_per_s.take().is_some());
    // A program of somebody's own need not tell its memory.
    assert!(peak_bytes.take().is_some() || record.measured.device.as_deref() != Some("flex"));
    record
}

/// The columns that a clock or a meter measured.
const MEASURED: [&str; 3] = ["wall_s", "tokens_per_s", "peak_bytes"];

/// `runs.csv`, row by row, without the columns that differ from time to time.
pub fn timeless_table(results: &Path) -> Vec<Vec<String>> {
    let table = fs::read_to_string(results.join("runs.csv")).expect("the table is there");
    let mut rows = csv(&table);
    let measured: Vec<bool> =
        rows[0].iter().map(|name| MEASURED.contains(&name.as_str())).collect();
    assert_eq!(measured.iter().filter(|measured| **measured).count(), MEASURED.len());
    for row in &mut rows {
        assert_eq!(row.len(), measured.len());
        let mut place = measured.iter();
        row.retain(|_| !place.next().expect("as many as columns"));
    }
    rows
}

fn csv(table: &str) -> Vec<Vec<String>> {
    table.lines().map(|line| line.split(',').map(str::to_string).collect()).collect()
}

/// A column of `runs.csv`, row by row, as it is written there.
pub fn column(results: &Path, name: &str) -> Vec<String> {
    let table = fs::read_to_string(results.join("runs.csv")).expect("the table is there");
    let rows = csv(&table);
    let place = rows[0].iter().position(|column| column == name).expect("the column is there");
    rows[1..].iter().map(|row| row[place].clone()).collect()
}

/// What evaluators and scores of a sweep's folder are, by path, without what a clock measured.
pub fn timeless_scores(results: &Path) -> BTreeMap<String, Value> {
    let mut found = BTreeMap::new();
    for (kind, product) in [("evaluators", "gates.json"), ("scores", "scores.json")] {
        for folder in fs::read_dir(results.join(kind)).into_iter().flatten().flatten() {
            let path = folder.path().join(product);
            let Ok(bytes) = fs::read(&path) else { continue };
            let bytes = digest::without(bytes);
            let mut value: Value = serde_json::from_slice(&bytes).expect("a whole product");
            if let Some(wall_s) = value.pointer_mut("/course/wall_s") {
                *wall_s = Value::Null;
            }
            let name = folder.file_name().to_string_lossy().into_owned();
            found.insert(format!("{kind}/{name}"), value);
        }
    }
    found
}
