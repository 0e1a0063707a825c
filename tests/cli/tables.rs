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
fn taos_three_approaches_are_reproduced_and_the_slip_is_named() {
    let Some(table) = shared("scaling_with_vocab/exp_data.csv") else { return };
    let laws = fit(&[&table, "--columns", TAO, "--compat", "tao", "--bootstrap", "0"]);
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
    near(&laws, "/parametric/objective", 0.06229135, 1e-7);
    near(&laws, "/tao/gamma", 0.83540, 1e-5);
    near(&laws, "/tao/approach1/huber/ln_nonvocab", -2.4838, 1e-4);
    near(&laws, "/tao/approach1/huber/exponent_vocab", 0.4356, 1e-4);
    near(&laws, "/tao/approach1/least_squares/exponent_vocab", 0.4170, 1e-4);
    assert_eq!(laws["tao"]["approach1"]["huber"]["n"], 125);
    near(&laws, "/tao/correct/objective_sum", 0.06679, 1e-4);
    assert_eq!(number(&laws, "/tao/correct/alpha2"), 1.0);
    let warning = laws["warnings"][0].as_str().unwrap_or_default();
    assert!(warning.contains("not identified"), "{warning}");
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
fn rows_left_out_are_named() {
    let place = known();
    let args = ["fit", "runs.csv", "--columns", KNOWN, "--drop-highest", "1", "--law", "approach3"];
    place.isoflop(&args).exits(0).says("dropped row 9 (drop-highest)");
    let args = ["fit", "runs.csv", "--columns", KNOWN, "--where", "C > 1e18", "--json"];
    let laws = place.isoflop(&args).exits(0).says("54 of 63 rows pass").json();
    assert!(laws["notes"].to_string().contains("54 of 63"));
}
