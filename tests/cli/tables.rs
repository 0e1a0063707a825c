//! Laws of tables made elsewhere, and the published fits that ours must reach.

use std::path::Path;

use serde_json::Value;

use super::support::Place;

/// A table of runs that others made; none, with a sentence, where it is not at hand.
fn shared(name: &str) -> Option<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/runs").join(name);
    if path.exists() {
        return Some(path.display().to_string());
    }
    eprintln!("skipped: {} is not here", path.display());
    None
}

fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no number at {pointer}"))
}

fn near(value: &Value, pointer: &str, wanted: f64, relative: f64) {
    let found = number(value, pointer);
    assert!((found / wanted - 1.0).abs() < relative, "{pointer}: {found} for {wanted}");
}

fn fit(args: &[&str]) -> Value {
    let args = [&["fit"], args, &["--json"]].concat();
    Place::new().isoflop(&args).exits(0).json()
}

const EPOCH: &str = "params=Model Size,budget_flops=Training FLOP,loss=loss";
/// f(V), the tokens of a character, times the characters.
const TAO: &str = "params_nonvocab=Non_vocab_parameters,n_vocab=vocab_size,d_model=embed_dim,\
                   flops=FLOPs,loss=Lossu,tokens=num_characters*(0.00639222*ln(vocab_size)^2\
                   -0.15811069*ln(vocab_size)+1.20470122)";

#[test]
fn epochs_chinchilla_is_reached_to_seven_digits_with_its_published_errors() {
    let Some(table) = shared("epoch_chinchilla/svg_extracted_data.csv") else { return };
    let laws = fit(&[&table, "--columns", EPOCH, "--compat", "epoch", "--predict", "5.76e23"]);
    let parametric = &laws["parametric"];
    near(parametric, "/objective", 1.0182740178006e-3, 1e-12);
    for (name, wanted) in [
        ("A", 477.82584),
        ("B", 2143.41736),
        ("E", 1.81721809),
        ("alpha", 0.34731050),
        ("beta", 0.36717243),
    ] {
        near(parametric, &format!("/{name}"), wanted, 1e-6);
    }
    assert_eq!((&parametric["starts"], &parametric["n"]), (&4500.into(), &240.into()));
    assert!(number(parametric, "/starts_at_optimum") > 2000.0);
    assert_eq!(parametric["replicates_converged"], 4000);
    for (name, se) in
        [("A", 124.5), ("B", 1293.2), ("E", 0.02566), ("alpha", 0.01540), ("beta", 0.02059)]
    {
        near(parametric, &format!("/se/{name}"), se, 1e-3);
    }
    let exponent = &laws["power_laws"]["params"];
    near(exponent, "/exponent_ci95/0", 0.4805, 1e-3);
    near(exponent, "/exponent_ci95/1", 0.5561, 1e-3);
    near(&laws, "/predictions/0/params", 73.19e9, 1e-3);
    near(&laws, "/predictions/0/tokens", 1.3116e12, 1e-3);
}

#[test]
fn the_default_search_finds_the_same_optimum_as_all_starts() {
    let Some(table) = shared("epoch_chinchilla/svg_extracted_data.csv") else { return };
    let options =
        ["--law", "approach3", "--drop-highest", "5", "--huber", "1e-3", "--bootstrap", "4000"];
    let laws = fit(&[&[table.as_str(), "--columns", EPOCH], &options[..]].concat());
    near(&laws, "/parametric/objective", 1.0182740178006e-3, 1e-12);
    near(&laws, "/parametric/se/B", 1293.2, 1e-3);
    assert_eq!(laws["dropped"].as_array().map(Vec::len), Some(5));
}

#[test]
fn the_collections_optima_are_reached() {
    let Some(table) = shared("isoflop_collection/isoflops.csv") else { return };
    let cases: [(&str, f64, [f64; 5]); 3] = [
        (
            "epochai_chinchilla__massivetext__chinchilla",
            33.2143e-6,
            [1.9894, 5.0524, 1.1402, 0.40709, 0.54400],
        ),
        (
            "ml_scalefit__massivetext__chinchilla",
            13.0887e-6,
            [1.8719, 4.3056, 1.0524, 0.36916, 0.40239],
        ),
        ("marin_202603__comma__llama_2", 22.9076e-6, [2.7014, 21.5082, 0.9866, 0.66352, 0.34834]),
    ];
    for (experiment, objective, coefficients) in cases {
        let rows = format!("experiment == \"{experiment}\"");
        let laws = fit(&[
            &table,
            "--columns",
            "params=params/1e6,tokens=tokens/1e9,budget_flops=budget,loss=loss",
            "--where",
            &rows,
            "--law",
            "approach3",
            "--space",
            "raw",
            "--huber",
            "1e-3",
            "--bootstrap",
            "0",
        ]);
        let found = number(&laws, "/parametric/objective");
        assert!(found / objective < 1.0 + 1e-6, "{experiment}: {found}");
        for (name, wanted) in ["E", "A", "B", "alpha", "beta"].iter().zip(coefficients) {
            near(&laws, &format!("/parametric/{name}"), wanted, 5e-5);
        }
    }
}

#[test]
fn taos_optimum_is_reached_by_columns_in_their_units() {
    let Some(table) = shared("scaling_with_vocab/exp_data.csv") else { return };
    let columns = "params_nonvocab=Non_vocab_parameters/1e6,params_vocab=vocab_size*embed_dim/1e6,\
                   loss=Lossu,tokens=num_characters/1e9*(0.00639222*ln(vocab_size/1000)^2\
                   -0.15811069*ln(vocab_size/1000)+1.20470122)";
    let options = ["--columns", columns, "--where", "FLOPs >= 2.18e17", "--bootstrap", "0"];
    let law = ["--law", "approach3-vocab", "--huber", "1e-3", "--tied"];
    let laws = fit(&[&[table.as_str()], &options[..], &law].concat());
    for (name, wanted) in [
        ("A1", 1.82888),
        ("A2", 0.190668),
        ("B", 2.121973),
        ("E", 5.534943),
        ("alpha1", 0.445317),
        ("alpha2", 0.663671),
        ("beta", 0.445317),
    ] {
        near(&laws, &format!("/parametric/{name}"), wanted, 3e-6);
    }
    near(&laws, "/parametric/objective_sum", 0.06229135, 1e-7);
}

#[test]
fn taos_table_fitted_rightly_says_which_exponent_it_does_not_hold() {
    let Some(table) = shared("scaling_with_vocab/exp_data.csv") else { return };
    let options = ["--law", "approach3-vocab", "--bootstrap", "0"];
    let laws = fit(&[&[table.as_str(), "--columns", TAO], &options[..]].concat());
    let warnings = laws["parametric"]["warnings"].to_string();
    assert!(warnings.contains("is not identified"), "{warnings}");
}

/// Seven budgets of nine sizes each, of a law that is known, without noise.
fn known() -> Place {
    let mut text = String::from("model,N in millions,D (billions),C,L\n");
    for budget in [1e18, 3e18, 1e19, 3e19, 1e20, 3e20, 1e21f64] {
        for size in -4..=4 {
            let n = (budget / 6.0).sqrt() / 4.0 * 1.5f64.powi(size);
            let d = budget / 6.0 / n;
            let loss = 1.8 + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37);
            text += &format!("\"m{size}, x\",{},{},{budget:e},{loss}\n", n / 1e6, d / 1e9);
        }
    }
    let place = Place::new();
    place.write("runs.csv", text);
    place
}

const KNOWN: &str = "params=N in millions*1e6,tokens=D (billions)*1e9,budget_flops=C,loss=L";

#[test]
fn a_table_with_names_and_units_of_its_own_gives_every_law_and_an_optimum() {
    let place = known();
    let exponent = 0.37 / 0.72;
    for (law, within) in [("isoflop", 0.01), ("approach1", 0.05), ("approach3", 1e-4)] {
        let args = ["fit", "runs.csv", "--columns", KNOWN, "--law", law, "--json"];
        let laws = place.isoflop(&args).exits(0).json();
        let found = number(&laws, "/power_laws/params/exponent");
        assert!((found - exponent).abs() < within, "{law}: {found}");
        assert!(laws["power_laws"]["params_nonvocab"].is_null());
        assert_eq!(laws["predictions"].as_array().map(Vec::len), Some(2), "{law}");
        near(&laws, "/predictions/1/budget_flops", 1e22, 1e-9);
    }
    assert_eq!(place.names("."), ["runs.csv"], "a table's fit writes nothing unasked");
}

#[test]
fn laws_of_a_table_predict_from_their_file() {
    let place = known();
    let fit = ["fit", "runs.csv", "--columns", KNOWN, "--law", "approach3", "--out", "laws.json"];
    place.isoflop(&fit).exits(0);
    let predicted = place.isoflop(&["predict", "1e23", "--law", "laws.json", "--json"]);
    let prediction = predicted.exits(0).json()[0].clone();
    let g = (0.35 * 480.0 / (0.37 * 2100.0f64)).powf(1.0 / 0.72);
    near(&prediction, "/params", g * (1e23f64 / 6.0).powf(0.37 / 0.72), 1e-3);
    assert!(prediction["shape"].is_null() && prediction["n_vocab"].is_null());
}

#[test]
fn rows_in_other_units_are_a_doubt_of_the_answer() {
    let place = known();
    let columns = KNOWN.replace("*1e6", "");
    let fit = ["fit", "runs.csv", "--columns", &columns, "--law", "approach3"];
    let said = place.isoflop(&fit).exits(0).stdout();
    assert!(said.contains("budget_flops is 1.000e6 times 6 N D"), "{said}");
    assert!(!said.contains("No doubts"), "{said}");
    let laws = place.isoflop(&[&fit[..], &["--json"]].concat()).exits(0).json();
    assert_eq!(laws["answer"]["doubts"][0]["kind"], "rows");
}

#[test]
fn losses_below_zero_are_fitted_themselves() {
    let place = known();
    let columns = KNOWN.replace("loss=L", "loss=L-3");
    let fit = ["fit", "runs.csv", "--columns", &columns, "--law", "approach3"];
    let ended = place.isoflop(&[&fit[..], &["--json"]].concat()).exits(0);
    let laws = ended.says("so the loss itself is fitted").json();
    assert_eq!(laws["parametric"]["space"], "raw");
    near(&laws, "/parametric/alpha", 0.35, 1e-3);
    place.isoflop(&[&fit[..], &["--space", "log"]].concat()).exits(2).says("--space raw");
}

#[test]
fn the_loss_of_a_model_trained_past_its_optimum_stands_beside_the_optimum() {
    let place = known();
    let fit = ["fit", "runs.csv", "--columns", KNOWN, "--law", "approach3", "--out", "laws.json"];
    place.isoflop(&fit).exits(0);
    let ask = ["predict", "--params", "1e9", "--tokens", "1e12", "--law", "laws.json"];
    let found = place.isoflop(&[&ask[..], &["--json"]].concat()).exits(0).json()[0].clone();
    let loss = |n: f64, d: f64| 1.8 + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37);
    near(&found, "/loss_normalised", loss(1e9, 1e12), 1e-4);
    near(&found, "/flops", 6e21, 1e-9);
    let suffixed = ["predict", "--params", "1B", "--tokens", "1T", "--law", "laws.json", "--json"];
    assert_eq!(place.isoflop(&suffixed).exits(0).json()[0], found);
    let vocab = [&ask[..], &["--vocab", "50000"]].concat();
    place.isoflop(&vocab).exits(2).says("knows no vocabulary");
    let best = ["/optimum/params", "/optimum/tokens"].map(|at| number(&found, at));
    near(&found, "/optimum/loss_normalised", loss(best[0], best[1]), 1e-4);
    let lost = loss(1e9, 1e12) - loss(best[0], best[1]);
    near(&found, "/loss_above_optimum", lost, 1e-2);
    assert!(number(&found, "/flops_of_equal_loss") < 6e21);
    assert!(number(&found, "/ci95/loss_normalised/0") <= loss(1e9, 1e12) + 1e-4);
    let text = place.isoflop(&ask).exits(0).stdout();
    assert!(text.contains("best model for the same FLOPs") && text.contains("(loss: L)"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
    let minima = ["fit", "runs.csv", "--columns", KNOWN, "--law", "approach1", "--out", "one.json"];
    place.isoflop(&minima).exits(0);
    let ask = ["predict", "--params", "1e9", "--tokens", "1e12", "--law", "one.json"];
    place.isoflop(&ask).exits(2).says("--law approach3");
}

#[test]
fn a_prediction_names_its_law_and_takes_budgets_in_a_list() {
    let place = known();
    place.isoflop(&["predict", "1e18"]).exits(2).says("--law scamo").does_not_say("here:");
    std::fs::create_dir_all(place.path("results/mine")).unwrap();
    let fit = ["fit", "runs.csv", "--columns", KNOWN, "--out", "results/mine/laws.json"];
    place.isoflop(&fit).exits(0);
    place.isoflop(&["predict", "1e18"]).exits(2).says("here: --law results/mine");
    let args = ["predict", "1e22,2e22", "3e22", "--law", "results/mine", "--json"];
    let found = place.isoflop(&args).exits(0).json();
    let budgets: Vec<f64> = (0..3).map(|i| number(&found, &format!("/{i}/budget_flops"))).collect();
    assert_eq!(budgets, [1e22, 2e22, 3e22]);
}

#[test]
fn a_fit_fits_the_terminal() {
    let place = known();
    for law in ["isoflop", "approach1", "approach3"] {
        let text = place.isoflop(&["fit", "runs.csv", "--columns", KNOWN, "--law", law]).exits(0);
        for line in text.stdout().lines() {
            assert!(line.chars().count() <= 80, "{line}");
        }
    }
}

#[test]
fn what_a_table_cannot_tell_is_said_with_its_own_exit_code() {
    let place = known();
    let fit = |args: &[&str]| place.isoflop(&[&["fit", "runs.csv"], args].concat());
    let columns = ["--columns", KNOWN];
    fit(&columns[..1]).exits(2);
    fit(&["--columns", "params=N in milions,loss=L"]).exits(2).says("N in millions");
    fit(&["--columns", "parms=C,loss=L"]).exits(2).says("params");
    fit(&[&columns[..], &["--where", "L < "]].concat()).exits(2).says("--where");
    fit(&[&columns[..], &["--where", "L < 0"]].concat()).exits(2).says("L < 0");
    fit(&[&columns[..], &["--outliers", "sline"]].concat()).exits(2).says("spline");
    fit(&[&columns[..], &["--huber", "0"]].concat()).exits(2).says("above 0");
    fit(&[&columns[..], &["--minima", "surface"]].concat()).exits(2).says("surface");
    fit(&[&columns[..], &["--law", "approach3-vocab"]].concat()).exits(3).says("N_nv and N_v");
    fit(&[&columns[..], &["--where", "C == 1e20"]].concat()).exits(3).says("1 budget");
    let no_budgets = "params=N in millions*1e6,tokens=D (billions)*1e9,loss=L";
    fit(&["--columns", no_budgets]).exits(3).says("budget_flops");
    fit(&["--columns", no_budgets, "--law", "approach3"]).exits(0);
}

#[test]
fn a_table_without_a_law_is_told_and_has_its_own_exit_code() {
    let place = known();
    // Digits that follow neither N nor D.
    let scatter = "(sqrt(N in millions)*7919.31-floor(sqrt(N in millions)*7919.31))";
    let fit = |loss: &str, law: &str| {
        let columns = KNOWN.replace("loss=L", &format!("loss={loss}"));
        place.isoflop(&["fit", "runs.csv", "--columns", &columns, "--law", law])
    };
    for law in ["approach1", "approach3"] {
        fit("3+0*L", law).exits(3).says("all 63 losses are 3: the table holds no law");
        fit("C^(-0.05)", law).exits(3).says("at each budget the losses of all sizes are equal");
        fit(&format!("3+{scatter}"), law).exits(3).says("no better than chance");
    }
    let of_data = "2+2100*(D (billions)*1e9)^(-0.37)";
    fit(of_data, "approach1")
        .exits(3)
        .says("the frontier of the lowest loss has the smallest size");
    let said = fit(of_data, "approach3").exits(3).stdout();
    assert!(said.contains("The term of N is not identified"), "{said}");
    assert!(said.contains("No exponent is determined"), "{said}");
}

#[test]
fn rows_left_out_are_named() {
    let place = known();
    let args = ["fit", "runs.csv", "--columns", KNOWN, "--drop-highest", "1", "--law", "approach3"];
    place.isoflop(&args).exits(0).says("dropped row 9 (drop-highest)");
    let args = ["fit", "runs.csv", "--columns", KNOWN, "--where", "C > 1e18", "--json"];
    let laws = place.isoflop(&args).exits(0).says("54 of 63 rows pass").json();
    assert!(laws["notes"].to_string().contains("54 of 63"));
}

/// Two experiments of one law with other floors, three budgets of nine sizes each, and one of a size.
fn experiments() -> Place {
    let mut text = String::from("experiment,params,tokens,budget_flops,loss\n");
    for (name, floor) in [("ours", 1.8), ("theirs", 2.4)] {
        for budget in [1e18, 1e19, 1e20f64] {
            for size in -4..=4 {
                let n = (budget / 6.0).sqrt() / 4.0 * 1.5f64.powi(size);
                let d = budget / 6.0 / n;
                let loss = floor + 480.0 * n.powf(-0.35) + 2100.0 * d.powf(-0.37);
                text += &format!("{name},{n},{d},{budget:e},{loss}\n");
            }
        }
    }
    for budget in [1e18, 1e19, 1e20] {
        text += &format!("one size,1e8,{},{budget:e},3\n", budget / 6e8);
    }
    let place = Place::new();
    place.write("runs.csv", text);
    place
}

#[test]
fn groups_of_a_column_are_fitted_side_by_side_and_one_that_cannot_be_says_why() {
    let place = experiments();
    let ended = place.isoflop(&["fit", "runs.csv"]).exits(0);
    ended.says(
        "column `experiment` has 3 values; their rows are fitted as one law: --by experiment",
    );
    let args = ["fit", "runs.csv", "--by", "experiment", "--law", "approach3", "--bootstrap", "50"];
    let text = place.isoflop(&args).exits(0).stdout();
    for words in ["experiment = ours, 27 runs", "experiment = theirs", "cannot be fitted: "] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let more = ["--out", "laws", "--json"];
    let found = place.isoflop(&[&args[..], &more].concat()).exits(0).does_not_say("--by").json();
    assert_eq!(found["by"], "experiment");
    near(&found, "/groups/ours/parametric/E", 1.8, 1e-3);
    near(&found, "/groups/theirs/parametric/E", 2.4, 1e-3);
    assert!(found["groups"]["one size"].is_null());
    assert!(
        found["failed"]["one size"].as_str().is_some_and(|why| why.contains("rows")),
        "{found}"
    );
    assert_eq!(place.names("laws"), ["ours.json", "theirs.json"]);
    place.isoflop(&["predict", "1e21", "--law", "laws/theirs.json"]).exits(0);
    for args in [&["plot", "laws"][..], &["report", "laws"], &["predict", "1e21", "--law", "laws"]]
    {
        place.isoflop(args).exits(2).says("laws holds laws of groups: name one, as laws/ours.json");
    }
    let slip = ["fit", "runs.csv", "--where", "experiment = ours"];
    place.isoflop(&slip).exits(2).says("did you mean the text 'ours'?");
    let one = ["--where", "experiment == \"one size\""];
    place.isoflop(&[&args[..], &one].concat()).exits(3).says("none of the 1 groups");
    let slip = ["fit", "runs.csv", "--by", "experimnet"];
    place.isoflop(&slip).exits(2).says("did you mean `experiment`");
    let slip = ["fit", "runs.csv", "--by", "experiment", "--columns", "loss=los"];
    place.isoflop(&slip).exits(2).says("los");
}

#[test]
fn numbers_as_people_write_them_are_read_and_told() {
    let place = Place::new();
    let mut text = String::from("size;tokens;budget;ce\n");
    for budget in [1e18, 1e19, 1e20f64] {
        for size in -3..=3 {
            let n = (budget / 6.0).sqrt() / 4.0 * 1.5f64.powi(size);
            let loss = 1.8 + 480.0 * n.powf(-0.35) + 2100.0 * (budget / 6.0 / n).powf(-0.37);
            let comma = |x: f64, digits: usize| format!("{x:.digits$e}").replace('.', ",");
            let d = comma(budget / 6.0 / n, 8);
            text += &format!(
                "{:.9}M;{d};{budget:e};{}\n",
                n / 1e6,
                format!("{loss:.9}").replace('.', ",")
            );
        }
    }
    text += "-;1,5e9;1e20;2,5\n";
    place.write("runs.csv", text);
    let columns = "params=size,tokens=tokens,budget_flops=budget,loss=ce";
    let args = ["fit", "runs.csv", "--columns", columns, "--law", "approach3", "--json"];
    let ended = place.isoflop(&args).exits(0).says("separated by semicolons");
    let ended =
        ended.says("column `size`: ").says("M is read as ").says("dropped row 22 (missing)");
    near(&ended.json(), "/parametric/alpha", 0.35, 1e-2);
    place.write("unclear.csv", "params,tokens,loss\n\"1,234\",1e9,3\n\"2,345\",2e9,2.9\n");
    let args = ["fit", "unclear.csv", "--law", "approach3"];
    place.isoflop(&args).exits(2).says("`1,234` may be 1234 or 1.234: write the one that is meant");
    place.write("tabs.csv", "params\ttokens\tbudget_flops\tloss\n7M\t1.5k\t6.3e10\t3\n");
    place
        .isoflop(&["fit", "tabs.csv"])
        .exits(3)
        .says("separated by tabs")
        .says("7M is read as 7e6");
}

#[test]
fn a_table_and_a_laws_file_have_the_figures_and_the_page_that_they_allow() {
    let place = known();
    let columns = ["--columns", KNOWN];
    let plot = [&["plot", "runs.csv", "--format", "svg"][..], &columns].concat();
    let ended = place.isoflop(&plot).exits(0).says("vocabulary's parameters are not told apart");
    assert!(ended.stdout().contains("runs-figures/isoflop_parabolas.svg"), "{}", ended.stdout());
    let svg = String::from_utf8(place.read("runs-figures/power_laws.svg")).unwrap();
    assert!(svg.contains("Model size N") && !svg.contains("Non-vocabulary"), "names of a table");
    let fit = [&["fit", "runs.csv", "--out", "laws.json"][..], &columns].concat();
    place.isoflop(&fit).exits(0);
    let args = ["plot", "laws.json", "--out", "drawn", "--format", "svg"];
    place.isoflop(&args).exits(0).says("isoflop_parabolas is left out");
    assert_eq!(place.names("drawn"), ["loss_vs_budget.svg", "power_laws.svg"]);
    for (source, file) in [("runs.csv", "runs.html"), ("laws.json", "laws.html")] {
        let more = if source == "runs.csv" { &columns[..] } else { &[] };
        place.isoflop(&[&["report", source][..], more].concat()).exits(0);
        let page = String::from_utf8(place.read(file)).unwrap();
        assert!(page.contains("Power laws through the minima") && !page.contains("L_u"), "{file}");
    }
    place.isoflop(&["plot", "laws.json", "--columns", "loss=L"]).exits(2).says("holds laws");
    place.isoflop(&["plot", "runs.csv", "--columns", "loss=nope"]).exits(2).says("nope");
}

#[test]
fn laws_of_tables_are_compared_by_their_files() {
    let place = known();
    let laws = ["fit", "runs.csv", "--columns", KNOWN, "--out", "a.json"];
    place.isoflop(&laws).exits(0);
    let laws = ["fit", "runs.csv", "--columns", KNOWN, "--law", "approach3", "--out", "b.json"];
    place.isoflop(&laws).exits(0);
    let found = place.isoflop(&["compare", "a.json", "b.json", "--json"]).exits(0).json();
    assert_eq!(found["studies"], serde_json::json!(["a", "b"]));
    assert_eq!(found["quantities"][0]["name"], "exponent of N in C");
    assert_eq!(found["sweeps"], serde_json::json!([]));
    place.isoflop(&["compare", "a.json", "a.json", "--out", "drawn"]).exits(0);
    assert!(place.names("drawn").contains(&"compare.svg".to_string()));
}

#[test]
fn rows_that_the_optimum_hangs_on_are_named() {
    let Some(table) = shared("epoch_chinchilla/svg_extracted_data.csv") else { return };
    let options = ["--law", "approach3", "--predict", "5.76e23", "--json"];
    let args = [&["fit", table.as_str(), "--columns", EPOCH], &options[..]].concat();
    let laws = Place::new().isoflop(&args).exits(0).json();
    let said = laws["answer"]["doubts"][0]["what"].as_str().unwrap_or_default();
    assert!(said.starts_with("5 row(s) move the optimal N"), "{said}");
    let influence = laws["parametric"]["influence"].clone();
    assert_eq!(influence["rows"].as_array().map(Vec::len), Some(5));
    let factor = number(&influence, "/params") / number(&influence, "/params_without");
    assert!((1.6..1.8).contains(&factor), "{factor}");
    let dropped = [&args[..], &["--drop-highest", "5"]].concat();
    Place::new().isoflop(&dropped).exits(0).does_not_say("without row 1,");
}

#[test]
fn a_vocabulary_known_by_its_parameters_alone_is_fitted() {
    let mut text = String::from("params_nonvocab,params_vocab,tokens,budget_flops,loss\n");
    for budget in [1e18, 1e19, 1e20f64] {
        for size in -3..=3 {
            for vocab in -2..=2 {
                let n = (budget / 6.0).sqrt() / 4.0 * 1.5f64.powi(size);
                let v = 0.6 * n.powf(0.95) * 2f64.powi(vocab);
                let d = budget / 6.0 / (n + v);
                let loss =
                    480.0 * n.powf(-0.35) + 8.0 * v.powf(-0.2) + 2100.0 * d.powf(-0.37) - 6.0;
                text += &format!("{n},{v},{d},{budget:e},{loss}\n");
            }
        }
    }
    let place = Place::new();
    place.write("runs.csv", text);
    let args = ["fit", "runs.csv", "--law", "approach3-vocab", "--out", "laws.json", "--json"];
    let laws = place.isoflop(&args).exits(0).json();
    near(&laws, "/parametric/alpha2", 0.2, 0.05);
    let ask = ["predict", "--params", "1e9", "--tokens", "1e10", "--law", "laws.json"];
    place.isoflop(&ask).exits(2).says("--params-vocab N_v");
    let found = place.isoflop(&[&ask[..], &["--params-vocab", "1e8", "--json"]].concat());
    near(&found.exits(0).json(), "/0/flops", 6.6e19, 1e-9);
    let laws = place.isoflop(&["fit", "runs.csv", "--json"]).exits(0).json();
    assert!(laws["power_laws"]["params_vocab"].is_object(), "{}", laws["power_laws"]);
}
