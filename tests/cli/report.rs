//! `isoflop report`: one page, whose numbers are those of the other commands.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

use super::support::{Place, lawful};

/// A sweep with laws, and its page.
fn reported() -> (Place, String) {
    let place = lawful();
    place.isoflop(&["run", "lawful.yaml"]).exits(0);
    let said = place.isoflop(&["report", "results/lawful"]).exits(0).stdout();
    assert!(said.contains("results/lawful/report.html"), "{said}");
    let page = String::from_utf8(place.read("results/lawful/report.html")).expect("text");
    (place, page)
}

/// What stands between two marks.
fn between<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    let from = text.find(start).unwrap_or_else(|| panic!("no {start}")) + start.len();
    let length = text[from..].find(end).unwrap_or_else(|| panic!("no {end}"));
    &text[from..from + length]
}

fn predictions(page: &str) -> Vec<Value> {
    let mark = "<script id=\"predictions\" type=\"application/json\">";
    serde_json::from_str(between(page, mark, "</script>")).expect("JSON")
}

#[test]
fn the_page_holds_all_and_asks_the_network_for_nothing() {
    let (place, page) = reported();
    for heading in ["Verdict", "Prediction", "IsoFLOP curves", "Laws", "Runs", "Figures"] {
        assert!(page.contains(&format!(">{heading}</h2>")), "{heading}");
    }
    let outside = ["src=\"http", "href=\"http", "url(http", "@import", "fetch(", "<link"];
    assert!(outside.iter().all(|word| !page.contains(word)));
    let csv = String::from_utf8(place.read("results/lawful/runs.csv")).expect("text");
    let table = between(&page, "<table id=\"table\">", "</table>");
    assert_eq!(table.matches("<tr>").count(), csv.lines().count(), "a row a run, and the head");
    // The same again is the same page.
    place.isoflop(&["report", "results/lawful", "--out", "again.html"]).exits(0);
    assert_eq!(String::from_utf8(place.read("again.html")).expect("text"), page);
}

#[test]
fn the_sliders_numbers_are_those_of_predict() {
    let (place, page) = reported();
    let all = predictions(&page);
    assert!(all.len() > 20, "{}", all.len());
    for shown in [&all[0], &all[all.len() / 2], &all[all.len() - 1]] {
        let budget = shown["budget_flops"].to_string();
        let said =
            place.isoflop(&["predict", &budget, "--law", "results/lawful"]).exits(0).stdout();
        for row in shown["rows"].as_array().expect("rows") {
            let [name, value, interval] = [0, 1, 2].map(|i| row[i].as_str().expect("text"));
            let line = said.lines().find(|line| line.trim_start().starts_with(name));
            let line = line.unwrap_or_else(|| panic!("no {name}: {said}"));
            assert!(line.contains(value) && line.ends_with(interval), "{row}: {line}");
        }
    }
}

#[test]
fn what_has_no_page_is_told() {
    let place = Place::new();
    place.isoflop(&["report", "nowhere"]).exits(2).says("nowhere");
}

/// A browser's page after its script ran, and what it complained of; `None` without a browser.
fn browsed(page: &Path, hash: &str) -> Option<(String, String)> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let options = ["--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom"];
    let logging = ["--enable-logging=stderr", "--virtual-time-budget=4000"];
    let address = format!("file://{}{hash}", page.display());
    let run =
        |name: &&str| Command::new(name).args(options).args(logging).arg(&address).output().ok();
    let output = names.iter().find_map(run)?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Some((text(&output.stdout), text(&output.stderr)))
}

#[test]
fn a_browser_shows_the_budget_that_is_asked_for() {
    let (place, page) = reported();
    let wanted = &predictions(&page)[7];
    let hash = format!("#{}", wanted["budget_flops"]);
    let Some((shown, log)) = browsed(&place.path("results/lawful/report.html"), &hash) else {
        eprintln!("skipped: there is no Chromium");
        return;
    };
    assert!(!log.contains("CONSOLE"), "{log}");
    let flops = between(&shown, "<output id=\"flops\" for=\"budget\">", "<");
    assert_eq!(wanted["flops"], flops);
    let configuration = between(&shown, "<tbody id=\"configuration\">", "</tbody>");
    for row in wanted["rows"].as_array().expect("rows") {
        let value = row[1].as_str().expect("text");
        assert!(configuration.contains(&format!("<td>{value}</td>")), "{row}: {configuration}");
    }
    let runs = between(&shown, "<span id=\"shown\" aria-live=\"polite\">", "<");
    assert_eq!(runs.split(" of ").collect::<Vec<_>>().len(), 2, "{runs}");
}
