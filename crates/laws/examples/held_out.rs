//! Exploration: forecasts of held-out budgets on tables.
use isoflop_laws::laws::*;
use isoflop_laws::predict::{PredictOptions, predict};
use isoflop_laws::table::{self, TableRequest};
use std::path::Path;

fn points(path: &str, columns: &str, filter: &str) -> Option<Vec<IsoFlopPoint>> {
    let request = TableRequest {
        columns: Some(columns.into()),
        filters: if filter.is_empty() { vec![] } else { vec![filter.into()] },
        ..TableRequest::default()
    };
    let read = table::read(Path::new(path)).ok()?;
    Some(table::load(&read, &request).map_err(|e| eprintln!("{path}: {e}")).ok()?.points)
}

fn main() {
    let shared = "../shared/data/runs/isoflop_collection/isoflops.csv";
    let own = "budget_flops=budget_flops,params_nonvocab=params_nonvocab,params_vocab=params_vocab,n_vocab=n_vocab,tokens=tokens,loss=loss_normalised";
    let mut tables = vec![];
    for e in ["epochai_chinchilla__massivetext__chinchilla","ml_scalefit__massivetext__chinchilla","marin_202603__comma__llama_2"] {
        tables.push((e.to_string(), points(shared, "budget_flops=budget", &format!("experiment == \"{e}\""))));
    }
    for s in ["cmu-motion","many-patches","motion-law","motion-law-again","own-frames","procedural-law","two-frames","two-frames-fixed"] {
        tables.push((s.to_string(), points(&format!("results/{s}/runs.csv"), own, "")));
    }
    let mut all: Vec<(bool, f64, f64, bool, f64, Vec<(String, f64)>)> = vec![];
    for (name, points) in tables {
        let Some(points) = points else { continue };
        let total = points.iter().all(|p| p.params_vocab == 0.0);
        let mut budgets: Vec<f64> = points.iter().map(|p| p.budget_flops).collect();
        budgets.sort_by(f64::total_cmp);
        budgets.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-6);
        let measured = |c: f64| {
            let of: Vec<&IsoFlopPoint> = points.iter().filter(|p| (p.budget_flops / c - 1.0).abs() < 1e-6).collect();
            let m = minimum_at(MinimumMethod::Akima, &of)?;
            Some(m)
        };
        for k in 3..budgets.len() {
            let seen: Vec<IsoFlopPoint> = points.iter().filter(|p| p.budget_flops <= budgets[k - 1] * 1.000001).cloned().collect();
            let options = FitOptions {
                bootstrap: 100,
                parameters: if total { Parameters::Total } else { Parameters::Split },
                methods: vec![MinimumMethod::Argmin, MinimumMethod::Parabola, MinimumMethod::Cubic, MinimumMethod::Akima],
                ..FitOptions::default()
            };
            let laws = match fit(&seen, &options) { Ok(l) => l, Err(e) => { println!("{name} k={k}: {e}"); continue } };
            for &c in &budgets[k..] {
                let factor = c / budgets[k - 1];
                let Some(m) = measured(c) else { continue };
                let Ok(p) = predict(&laws, c, &PredictOptions::default()) else { println!("{name} k={k} {c:e} no prediction"); continue };
                let loss = p.loss_normalised.unwrap_or(f64::NAN);
                let err = loss - m.loss_normalised;
                let ci = p.ci95.loss_normalised.unwrap_or([f64::NAN; 2]);
                let held = ci[0] <= m.loss_normalised && m.loss_normalised <= ci[1];
                let size = p.params.or(p.params_nonvocab).unwrap();
                let each = vec![("log".into(), p.raw.loss_log), ("floor".into(), p.raw.loss_floor), ("joint".into(), p.raw.loss_joint), ("together".to_string(), p.together.as_ref().map(|t| t.loss_normalised))];
                let each: Vec<(String, f64)> = each.into_iter().filter_map(|(n, l): (String, Option<f64>)| Some((n, l? - m.loss_normalised))).collect();
                let text = each.iter().map(|(n, e)| format!("{n} {e:+.3}")).collect::<Vec<_>>().join(" ");
                println!("{:.12} k={k} x{factor:<5.1} {:<13} {}: err {err:+.4} {} w {:.3} dlnN {:+.2}  {text}", name, laws.recommended_law().name(), laws.minima_method, if held {"in "} else {"OUT"}, ci[1] - ci[0], (size / m.params_nonvocab).ln());
                all.push((total, factor, err, held, ci[1] - ci[0], each));
            }
        }
    }
    for (label, of) in [("public <6", (true, 1.5, 6.0)), ("public 6-20", (true, 6.0, 20.0)), ("public >20", (true, 20.0, 1e9)), ("own <6", (false, 1.5, 6.0)), ("own 6-20", (false, 6.0, 20.0)), ("own >20", (false, 20.0, 1e9))] {
        let rows: Vec<_> = all.iter().filter(|r| r.0 == of.0 && r.1 >= of.1 && r.1 < of.2).collect();
        if rows.is_empty() { continue }
        let rms = |v: Vec<f64>| (v.iter().map(|e| e * e).sum::<f64>() / v.len() as f64).sqrt();
        let mut line = format!("{label}: n {} recommended {:.4} held {} width {:.3}", rows.len(), rms(rows.iter().map(|r| r.2).collect()), rows.iter().filter(|r| r.3).count(), rows.iter().map(|r| r.4).sum::<f64>() / rows.len() as f64);
        for n in ["log", "floor", "joint", "together"] {
            let v: Vec<f64> = rows.iter().filter_map(|r| Some(r.5.iter().find(|(m, _)| m == n)?.1)).collect();
            line += &format!(" {n} {:.4} ({})", rms(v.clone()), v.len());
        }
        println!("{line}");
    }
}
