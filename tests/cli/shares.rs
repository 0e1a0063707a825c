//! `grid.shares`: runs that see a part of the training split.

use super::support::Place;

const SHARES: [&str; 4] = ["--set", "grid.shares=[0.25, 1]", "--set", "seeds=[0]"];

#[test]
fn every_cell_is_trained_on_each_share_and_laws_of_minima_take_the_largest() {
    let place = Place::with("mini.yaml");
    let plan = |settings: &[&str]| {
        let asked = [&["plan", "mini.yaml", "--json"], settings].concat();
        place.isoflop(&asked).exits(0).json()["runs"].as_array().unwrap().clone()
    };
    let (plain, shared) = (plan(&SHARES[2..]), plan(&SHARES));
    let id = |run: &serde_json::Value| run["run_id"].as_str().unwrap().to_string();
    let ids: Vec<String> = shared.iter().map(id).collect();
    assert_eq!(shared.len(), 2 * plain.len());
    assert!(plain.iter().all(|run| ids.contains(&id(run))), "the whole has its ids");

    let fit = |name: &str| {
        let laws = place.read(&format!("results/{name}/laws.json"));
        let laws: serde_json::Value = serde_json::from_slice(&laws).unwrap();
        laws["minima"].clone()
    };
    place.isoflop(&[&["run", "mini.yaml"], &SHARES[2..]].concat()).exits(0);
    let own = fit("mini");
    place.isoflop(&[&["run", "mini.yaml"], &SHARES[..]].concat()).exits(0);
    assert_eq!(fit("mini"), own);

    let table = String::from_utf8(place.read("results/mini/runs.csv")).unwrap();
    let head: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|own| *own == name).unwrap();
    let values = |name: &str, share: &str| -> Vec<f64> {
        let rows = table.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
        let of_share = rows.filter(|row| row[column("share")] == share);
        of_share.map(|row| row[column(name)].parse().unwrap()).collect()
    };
    let [all, quarter] = ["1.0", "0.25"].map(|share| values("unique_tokens", share));
    assert_eq!([all.len(), quarter.len()], [plain.len(); 2], "{table}");
    assert!(all.iter().all(|n| quarter.iter().all(|part| part < n)));
    assert_ne!(values("loss_normalised", "1.0"), values("loss_normalised", "0.25"));
}

#[test]
fn shares_that_are_none_are_named() {
    let place = Place::with("mini.yaml");
    for (shares, words) in [
        ("[]", "no share, so no run"),
        ("[0, 1]", "0 is out of range: 1e-9 to 1"),
        ("[1, 1.5]", "1.5 is out of range"),
        ("[0.5, 0.5]", "stands in the list a second time"),
    ] {
        let setting = format!("grid.shares={shares}");
        place.isoflop(&["plan", "mini.yaml", "--set", &setting]).exits(2).says(words);
    }
    let rounds = [&["run", "mini.yaml", "--rounds", "2"], &SHARES[..]].concat();
    place.isoflop(&rounds).exits(2).says("among the values of grid.shares");
}
