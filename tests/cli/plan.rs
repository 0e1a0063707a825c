//! `isoflop plan`: prices, ids, states, what is dropped and what is stale.

use serde_json::Value;

use super::support::{Place, finished_mini};

const SCAMO: &str = "name: scamo-grid
data: {source: humanml3d, path: no/such/folder}
text: {max_tokens: 150}
grid: {models: scamo, vocab: [256, 1024, 65536], budgets: [1e18]}
";

fn list<'a>(document: &'a Value, name: &str) -> &'a [Value] {
    document[name].as_array().unwrap_or_else(|| panic!("{name} is no list in {document}"))
}

fn has_keys(value: &Value, keys: &[&str]) {
    let missing: Vec<_> = keys.iter().filter(|key| value.get(key).is_none()).collect();
    assert!(missing.is_empty(), "{missing:?} missing in {value}");
}

#[test]
fn a_plan_holds_every_key_that_scripts_read() {
    let place = Place::with("mini.yaml");
    let plan = place.isoflop(&["plan", "mini.yaml", "--json"]).exits(0).json();
    has_keys(&plan, &["runs", "dropped", "jobs", "total_flops", "hours", "disk_bytes"]);
    let jobs = serde_json::json!({
        "text": 1, "tokenizer": 2, "tokens": 2, "trunk": 0, "run": 8, "evaluator": 0, "score": 0,
    });
    assert_eq!(plan["jobs"], jobs);
    assert_eq!(list(&plan, "runs").len(), 8);
    for run in list(&plan, "runs") {
        has_keys(
            run,
            &[
                "run_id",
                "n_layer",
                "n_head",
                "d_model",
                "n_ctx",
                "n_vocab",
                "seed",
                "budget_flops",
                "flops_per_token_forward",
                "params_nonvocab",
                "params_vocab",
                "tokens",
                "steps",
                "batch_tokens",
                "lr",
                "achieved_ratio",
                "peak_bytes",
                "state",
            ],
        );
        has_keys(&run["flops_per_token_forward"], &["openai", "exact"]);
        assert_eq!(run["state"], "missing");
    }
    assert!(plan["hours"].as_f64().is_some_and(|hours| hours > 0.0), "{}", plan["hours"]);
    assert!(!place.path("results").exists(), "a plan writes nothing");
}

/// The integers follow from ScaMo's Code 1 at n_ctx = 201.
#[test]
fn the_published_grid_is_priced_without_its_data() {
    let place = Place::new();
    place.write("scamo.yaml", SCAMO);
    let ended = place.isoflop(&["plan", "scamo.yaml", "--json"]).exits(0);
    let ended = ended.says("no/such/folder").says("provisional").does_not_say("epochs, up to");
    let plan = ended.json();
    let flops = list(&plan, "runs").iter().map(|run| {
        assert_eq!(run["n_ctx"], 201);
        assert_eq!(run["epochs"], Value::Null, "without data there are no epochs to count");
        let price = run["flops_per_token_forward"]["openai"].as_u64().expect("a whole number");
        (run["d_model"].as_u64().unwrap(), run["n_vocab"].as_u64().unwrap(), price)
    });
    let expected = [
        (512, [52226048, 53004288, 117516288]),
        (768, [173945856, 175113216, 271881216]),
        (1024, [614354944, 615911424, 744935424]),
        (1280, [1434721280, 1436666880, 1597946880]),
        (1536, [2748291072, 2750625792, 2944161792]),
        (3200, [5930662400, 5935526400, 6338726400]),
    ];
    let expected = expected.into_iter().flat_map(|(d_model, prices)| {
        [240, 1000, 64000].into_iter().zip(prices).map(move |(v, price)| (d_model, v, price))
    });
    assert_eq!(flops.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
}

/// No other child of this process comes near the bound, so the largest of them is below it.
#[cfg(target_os = "linux")]
#[test]
fn pricing_billions_of_parameters_builds_none_of_them() {
    use nix::sys::resource::{UsageWho, getrusage};
    let place = Place::new();
    place.write("scamo.yaml", SCAMO);
    let plan = place.isoflop(&["plan", "scamo.yaml", "--json"]).exits(0).json();
    let largest = list(&plan, "runs").iter().filter_map(|run| run["peak_bytes"].as_u64()).max();
    assert!(largest > Some(40_000_000_000), "the grid is as large as it should be: {largest:?}");
    let peak_kib = getrusage(UsageWho::RUSAGE_CHILDREN).expect("Linux counts it").max_rss();
    assert!(peak_kib < 1_000_000, "{peak_kib} KiB");
}

#[test]
fn a_dropped_cell_is_listed_with_its_reason() {
    let place = Place::with("mini.yaml");
    let settings = ["--set", "train.min_steps=100", "--set", "grid.budgets=[1e9, 1e7]"];
    let exclude = ["--set", "grid.exclude=['n_vocab == 64 and budget > 1e8']"];
    let args = [&["plan", "mini.yaml", "--json"], &settings[..], &exclude].concat();
    let plan = place.isoflop(&args).exits(0).json();
    let reasons: Vec<&str> =
        list(&plan, "dropped").iter().map(|cell| cell["reason"].as_str().unwrap()).collect();
    let excluded = "excluded by `n_vocab == 64 and budget > 1e8`";
    assert_eq!(reasons.iter().filter(|reason| **reason == excluded).count(), 2);
    let short = reasons.iter().filter(|reason| reason.contains("train.min_steps = 100")).count();
    assert_eq!((short, reasons.len(), list(&plan, "runs").len()), (4, 6, 2));

    let text = |words: &[&str]| {
        let without_json = [&args[..2], &args[3..], words].concat();
        place.isoflop(&without_json).exits(0).stdout()
    };
    let screen = text(&[]);
    assert!(screen.contains("dropped: 2 cells by grid.exclude; --full lists them"), "{screen}");
    assert!(screen.contains("  and 1 more dropped; --full lists them"), "{screen}");
    assert_eq!(text(&["--full"]).matches("dropped: L").count(), 6);
}

#[test]
fn a_plan_shows_a_line_a_budget_and_every_run_on_demand() {
    let place = Place::with("mini.yaml");
    let rows = |words: &[&str]| {
        let asked = [&["plan", "mini.yaml", "--set", "seeds=[0, 1, 2]"], words].concat();
        let text = place.isoflop(&asked).exits(0).stdout();
        let budget = |line: &str| line.split_whitespace().next()?.parse::<f64>().ok();
        let is_row =
            |line: &&str| budget(line).is_some_and(|c| c >= 1e9) && !line.contains("FLOPs");
        text.lines().filter(is_row).count()
    };
    assert_eq!((rows(&[]), rows(&["--full"])), (2, 24), "two budgets, eight cells, three seeds");
}

#[test]
fn a_plan_says_what_is_done_and_which_field_made_the_rest_stale() {
    let place = finished_mini();
    let states = |args: &[&str]| {
        let plan =
            place.isoflop(&[&["plan", "mini.yaml", "--json"], args].concat()).exits(0).json();
        let states = list(&plan, "runs").iter().map(|run| run["state"].clone());
        (states.collect::<Vec<_>>(), plan["stale"].clone())
    };
    assert_eq!(states(&[]), (vec!["done".into(); 8], serde_json::json!([])));
    for (setting, fields) in [
        ("train.lr.coefficient=0.01", vec!["lr"]),
        ("train.betas=[0.9, 0.99]", vec!["betas"]),
        ("tokenizer.steps=21", vec!["tokenizer.steps"]),
        ("data.seed=1", vec!["data_digest"]),
        ("text.dim=8", vec!["generator.d_text", "text_id"]),
    ] {
        let stale = serde_json::json!([{ "runs": 8, "fields": fields }]);
        assert_eq!(states(&["--set", setting]), (vec!["missing".into(); 8], stale), "{setting}");
    }
    let other =
        place.isoflop(&["plan", "mini.yaml", "--set", "train.lr.coefficient=0.01"]).exits(0);
    assert!(other.stdout().contains("stale: 8 finished runs differ in lr"), "{}", other.stdout());
}

#[test]
fn a_shared_file_lies_below_a_sweep_and_a_number_is_a_rate() {
    let place = Place::with("mini.yaml");
    place.write("own.yaml", "include: mini.yaml\nname: own\ntrain: {lr: 3e-4, batch: 128}\n");
    let plan = place.isoflop(&["plan", "own.yaml", "--json"]).exits(0).json();
    assert_eq!(list(&plan, "runs").len(), 8, "the grid of the file below");
    for run in list(&plan, "runs") {
        assert_eq!((run["lr"].as_f64(), run["batch_tokens"].as_u64()), (Some(3e-4), Some(128)));
    }
    place.write("own.yaml", "include: absent.yaml\nname: own\n");
    place
        .isoflop(&["plan", "own.yaml"])
        .exits(2)
        .says("own.yaml:1:10")
        .says("cannot read absent.yaml");
}

#[test]
fn a_plan_says_what_fsq_makes_of_a_size() {
    let place = Place::new();
    place.write("scamo.yaml", SCAMO);
    let ended = place.isoflop(&["plan", "scamo.yaml"]).exits(0);
    assert!(ended.stdout().contains("240 for 256 (levels 8, 6, 5)"), "{}", ended.stdout());
    let plan = place.isoflop(&["plan", "scamo.yaml", "--json"]).exits(0).json();
    assert_eq!(list(&plan, "vocabularies")[1]["codes"], 1000);
}

/// On one screen: 287 runs of the published grid, with what they cost.
#[test]
fn a_plan_on_a_gpu_has_hours_dollars_and_memory() {
    let place = Place::new();
    let asked = ["plan", "scamo", "--gpu", "h100", "--price", "2.5"];
    let ended = place.isoflop(&asked).exits(0);
    let text = ended.stdout();
    assert!(
        text.contains("287 runs")
            && text.replace('\n', " ").contains("as on an H200 from 0.1M to 731M"),
        "{text}"
    );
    assert!(text.lines().count() <= 25, "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");

    let plan = place.isoflop(&[&asked[..], &["--json"]].concat()).exits(0).json();
    let number = |value: &Value| value.as_f64().unwrap_or_else(|| panic!("{value}"));
    let gpu = &plan["gpu"];
    let hours: f64 = list(&plan, "runs").iter().map(|run| number(&run["gpu_hours"])).sum();
    assert!((hours - number(&gpu["hours"])).abs() < 1e-9 * hours, "{hours} and {gpu}");
    assert!((2.5 * hours - number(&gpu["dollars"])).abs() < 1e-9 * hours, "{hours} and {gpu}");
    assert_eq!((&plan["hours"], &gpu["mfu"]["source"]), (&gpu["hours"], &"reference".into()));
    // No more than the largest MFU, and twice what the least would take at most.
    let at = |mfu: f64| number(&plan["total_flops"]) / (989e12 * mfu) / 3600.0;
    assert!((at(0.312)..2.0 * at(0.158)).contains(&hours), "{hours}");
    let bytes = list(&plan, "runs").iter().filter_map(|run| run["gpu_bytes"].as_u64());
    assert_eq!(bytes.clone().max(), gpu["peak_bytes"].as_u64());
    let large = bytes.filter(|bytes| *bytes > 80_000_000_000).count();
    assert_eq!(Some(large as u64), gpu["too_large"].as_u64());
    assert!(
        text.replace('\n', " ").contains(&format!("{large} of 287 runs do not fit on one h100")),
        "{text}"
    );
}

#[test]
fn the_sweep_names_a_card_and_its_mfu_and_the_command_line_another() {
    let place = Place::with("mini.yaml");
    let plan = |words: &[&str]| {
        let sweep = ["plan", "mini.yaml", "--set", "engine={gpu: l4, mfu: 0.5}", "--json"];
        place.isoflop(&[&sweep[..], words].concat()).exits(0).json()["gpu"].clone()
    };
    let (own, other) = (plan(&[]), plan(&["--gpu", "h100"]));
    assert_eq!((&own["name"], &other["name"]), (&"l4".into(), &"h100".into()));
    let told = serde_json::json!({"source": "told", "least": 0.5, "most": 0.5});
    assert_eq!((&own["mfu"], &own["dollars"]), (&told, &Value::Null));
    let none = place.isoflop(&["plan", "mini.yaml", "--json"]).exits(0).json();
    assert!(none.get("gpu").is_none() && none["runs"][0].get("gpu_hours").is_none());
}

#[test]
fn a_card_that_is_not_known_is_refused_with_the_nearest() {
    let place = Place::with("mini.yaml");
    place
        .isoflop(&["plan", "mini.yaml", "--gpu", "h10"])
        .exits(2)
        .says("similar value exists: 'h100'");
    for command in ["plan", "run"] {
        let ended = place.isoflop(&[command, "mini.yaml", "--set", "engine.gpu=h10"]).exits(2);
        ended.says("no card is named `h10`").says("did you mean `h100`?");
    }
    place
        .isoflop(&["plan", "mini.yaml", "--set", "engine.mfu=35"])
        .exits(2)
        .says("35 is out of range");
    place.isoflop(&["plan", "mini.yaml", "--price", "2"]).exits(2).says("--gpu or engine.gpu");
}

#[test]
fn a_run_that_does_not_fit_on_the_card_is_refused_before_anything_runs() {
    let place = Place::new();
    let small = ["--set", "data={clips: 16, val_clips: 4, test_clips: 8}"];
    let run = ["run", "scamo", "--set", "engine.gpu=l4"];
    let ended = place.isoflop(&[&run[..], &small].concat()).exits(2);
    ended.says("nothing was run").says("of 287 runs do not fit on one l4").says("24 GB");
    assert!(!place.path("results").exists());
}

#[test]
fn what_will_be_in_doubt_of_the_minima_is_told_with_what_to_change() {
    let place = Place::with("mini.yaml");
    let models =
        "grid.models=[{n_layer: 1, n_head: 1, d_model: 8}, {n_layer: 2, n_head: 1, d_model: 16}]";
    let plan = ["plan", "mini.yaml", "--json", "--set", models];
    let ended = place.isoflop(&plan).exits(0);
    let ended = ended.says("gap: neighbouring sizes").says("depth-change: ").says("few-levels: ");
    let document = ended.json();
    for doubt in list(&document, "doubts") {
        has_keys(doubt, &["kind", "what", "do", "budgets_flops"]);
    }
    assert_eq!(list(&document, "doubts")[0]["kind"], "gap");
    assert!(list(&document, "warnings").iter().all(Value::is_string));
}
