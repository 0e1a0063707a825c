//! `isoflop report`: one page, whose numbers are those of the other commands.

use std::path::Path;
use std::process::Command;

use isoflop::data::write_npy;
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
    let mark = "<script class=\"predictions\" type=\"application/json\">";
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

/// The page of a study of three generators, from its committed tables on.
fn of_several() -> (Place, String) {
    let place = Place::new();
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("results/quality");
    let copy = |file: &str| {
        let bytes = std::fs::read(committed.join(file)).expect("a committed file");
        let to = place.path("results/quality").join(file);
        std::fs::create_dir_all(to.parent().expect("a folder")).expect("a writable directory");
        std::fs::write(to, bytes).expect("a writable directory");
    };
    ["sweep.yaml", "runs.parquet"].into_iter().for_each(copy);
    for generator in GENERATORS {
        copy(&format!("generators/{generator}/runs.parquet"));
        let own = format!("results/quality/generators/{generator}");
        // Its optimum lies beyond the sizes tried, so no exponent is determined.
        place.isoflop(&["fit", &own, "--save"]).exits(3);
    }
    place.isoflop(&["plot", "results/quality", "--format", "svg"]).exits(0);
    place.isoflop(&["report", "results/quality", "--out", "page.html"]).exits(0);
    let page = String::from_utf8(place.read("page.html")).expect("text");
    (place, page)
}

const GENERATORS: [&str; 3] = ["autoregressive", "masked", "scalewise"];

#[test]
fn several_generators_stand_side_by_side_and_then_each_by_itself() {
    let (place, page) = of_several();
    for generator in GENERATORS {
        for heading in ["Verdict", "Prediction", "IsoFLOP curves", "Laws", "Figures"] {
            assert!(
                page.contains(&format!(">{heading}, {generator}</h2>")),
                "{heading} {generator}"
            );
        }
    }
    let beside = between(&page, "id=\"generators\"", "</table>");
    assert_eq!(beside.matches("<tr>").count(), 4, "a row a generator, and the head");
    let ids: Vec<&str> =
        page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let once: std::collections::HashSet<&&str> = ids.iter().collect();
    assert_eq!(once.len(), ids.len(), "{ids:?}");
    // Each slider stands on its own laws.
    let last = page.split("<script class=\"predictions\" type=\"application/json\">").last();
    let last = last.and_then(|text| text.split("</script>").next()).expect("predictions");
    let last: Vec<Value> = serde_json::from_str(last).expect("JSON");
    let budget = last[0]["budget_flops"].to_string();
    let own = "results/quality/generators/scalewise";
    let said = place.isoflop(&["predict", &budget, "--law", own]).exits(0).stdout();
    let value = last[0]["rows"][0][1].as_str().expect("text");
    assert!(said.contains(value), "{value}: {said}");
}

#[test]
fn every_generators_slider_moves_in_a_browser() {
    let (place, _) = of_several();
    let Some((shown, log)) = browsed(&place.path("page.html"), "") else {
        eprintln!("skipped: there is no Chromium");
        return;
    };
    assert!(!log.contains("CONSOLE"), "{log}");
    let configurations = shown.split("<tbody class=\"configuration\">").skip(1);
    let filled = configurations.filter(|rest| rest.starts_with("<tr><th scope=\"row\">"));
    assert_eq!(filled.count(), GENERATORS.len());
}

#[test]
fn what_is_planted_in_a_folder_does_not_run_and_a_diverged_motion_is_told() {
    let (place, _) = reported();
    let title = "document.title = 'planted'";
    let svg = |within: &str| format!("<svg xmlns=\"http://www.w3.org/2000/svg\">{within}</svg>");
    let script = svg(&format!("<script>{title}</script>"));
    place.write("results/lawful/figures/script.svg", script);
    let load = svg("<circle r=\"1\"/>").replace("<svg", &format!("<svg onload=\"{title}\""));
    place.write("results/lawful/figures/load.svg", load);
    let run = place.names("results/lawful/runs").remove(0);
    let caption = format!("</script><img src=x onerror=\"{title}\">");
    let made = |caption: &str| serde_json::json!({"caption": caption, "fps": 20.0});
    let listed = serde_json::json!([made("far"), made(&caption)]).to_string();
    let samples = place.path(&format!("results/lawful/samples/{run}"));
    std::fs::create_dir_all(&samples).expect("a writable directory");
    std::fs::write(samples.join("motions.json"), listed).expect("a writable directory");
    for (n, place) in [1e38, 0.5].into_iter().enumerate() {
        let path = samples.join(format!("{n}.features.npy"));
        write_npy(&path, &[60, 263], &[place; 60 * 263]).expect("a writable directory");
    }
    let ended = place.isoflop(&["report", "results/lawful"]).exits(0);
    let ended = ended.says("script.svg is left out").says("it holds `<script`");
    ended.says("load.svg is left out").says("it holds `onload=");
    let page = String::from_utf8(place.read("results/lawful/report.html")).expect("text");
    assert!(page.contains("of &quot;far&quot; is not shown: in frame 0 a joint"), "it is told");
    assert!(!page.contains("<img") && page.contains("&lt;img src=x"), "a word of the caption");
    let Some((shown, log)) = browsed(&place.path("results/lawful/report.html"), "") else {
        eprintln!("skipped: there is no Chromium");
        return;
    };
    assert!(!log.contains("CONSOLE"), "{log}");
    assert!(shown.contains("<title>lawful · isoflop</title>"), "nothing planted ran");
    assert_eq!(between(&shown, "<code id=\"maker\">", "<"), run, "the viewer plays");
}

#[test]
fn a_page_without_its_sweep_or_data_says_why_it_shows_no_true_motion() {
    let (place, _) = reported();
    let run = place.names("results/lawful/runs").remove(0);
    let samples = place.path(&format!("results/lawful/samples/{run}"));
    std::fs::create_dir_all(&samples).expect("a writable directory");
    let listed = serde_json::json!([{"caption": "a person walks", "fps": 20.0}]).to_string();
    std::fs::write(samples.join("motions.json"), listed).expect("a writable directory");
    let path = samples.join("0.features.npy");
    write_npy(&path, &[60, 263], &[0.5; 60 * 263]).expect("a writable directory");
    let report = || place.isoflop(&["report", "results/lawful"]).exits(0);
    report().does_not_say("true motion");
    let words = ["report", "results/lawful", "--withhold", "mine", "--note", "<b>seed</b> 0"];
    place.isoflop(&words).exits(0).says("--withhold mine names no data set of the sweep's union");
    let page = String::from_utf8(place.read("results/lawful/report.html")).expect("text");
    assert!(page.contains("<p class=\"note\">&lt;b&gt;seed&lt;/b&gt; 0</p>"), "a word of the user");
    let table = ["report", "results/lawful/runs.csv", "--captions", "3"];
    place.isoflop(&table).exits(2).says("a table has no motions");
    let whole = String::from_utf8(place.read("results/lawful/sweep.yaml")).expect("text");
    let changed = whole.replace("clips: 1", "clips: 2");
    assert!(changed != whole);
    place.write("results/lawful/sweep.yaml", changed);
    let ended = report().says("No true motion is shown: ").says("the page has no sweep: ");
    ended.says("sweep.yaml is damaged (its bytes are not those that were written");
    let page = String::from_utf8(place.read("results/lawful/report.html")).expect("text");
    assert!(page.contains("No true motion is shown: "));
    place.write("results/lawful/sweep.yaml", "name: [");
    report().says("No true motion is shown: not valid YAML");
    std::fs::remove_file(place.path("results/lawful/sweep.yaml")).expect("a file");
    report().says("No true motion is shown: cannot read ");
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
    let flops = between(&shown, "<output class=\"flops\" for=\"budget\">", "<");
    assert_eq!(wanted["flops"], flops);
    let configuration = between(&shown, "<tbody class=\"configuration\">", "</tbody>");
    for row in wanted["rows"].as_array().expect("rows") {
        let value = row[1].as_str().expect("text");
        assert!(configuration.contains(&format!("<td>{value}</td>")), "{row}: {configuration}");
    }
    let runs = between(&shown, "<span id=\"shown\" aria-live=\"polite\">", "<");
    assert_eq!(runs.split(" of ").collect::<Vec<_>>().len(), 2, "{runs}");
}
