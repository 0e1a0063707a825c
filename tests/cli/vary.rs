//! `grid.vary`: other keys as axes of the grid.

use super::support::Place;

const VARIED: [&str; 4] = ["--set", "grid.vary={train.lr: [1e-4, 1e-2]}", "--set", "seeds=[0]"];

#[test]
fn every_cell_is_trained_in_each_variant_and_taken_at_its_best() {
    let place = Place::with("mini.yaml");
    let plain =
        place.isoflop(&["plan", "mini.yaml", "--json", VARIED[2], VARIED[3]]).exits(0).json();
    let plan = place.isoflop(&[&["plan", "mini.yaml"], &VARIED[..]].concat()).exits(0).stdout();
    assert!(plan.contains("each cell in 2 variants"), "{plan}");
    let n = plain["runs"].as_array().unwrap().len();
    let ended = place.isoflop(&[&["run", "mini.yaml"], &VARIED[..]].concat()).exits(0);
    ended.says(&format!("each of {n} cells is taken at its best variant"));
    let table = String::from_utf8(place.read("results/mini/runs.csv")).unwrap();
    let of = |label: &str| table.lines().filter(|line| line.contains(label)).count();
    assert_eq!((of("train.lr=0.0001"), of("train.lr=0.01")), (n, n), "{table}");
    let again = place.isoflop(&[&["run", "mini.yaml"], &VARIED[..]].concat()).exits(0);
    again.says("nothing to train");
    let rounds = [&["run", "mini.yaml", "--rounds", "2"], &VARIED[..]].concat();
    place.isoflop(&rounds).exits(2).says("--rounds chooses cells");
}
