//! Tests of the module above.

use super::*;
use isoflop::record::{Measured, Metrics, Planned, RunRecord};
use isoflop::scores::Repeated;

fn rows(evaluator_id: &str, fids: &[f64]) -> Vec<Quality> {
    let row = |(run, fid): (usize, &f64)| {
        let planned = Planned { run_id: format!("run {run}"), ..Planned::default() };
        let score = |mean: f64| Some(Repeated { mean, half_width: 0.0, repeats: 2 });
        Quality {
            run: RunRecord::new(planned, Measured::default(), Metrics::default()),
            evaluator_id: evaluator_id.to_string(),
            guidance: 0.0,
            scores: vec![("fid", score(*fid)), ("r_precision_1", score(-fid))],
        }
    };
    fids.iter().enumerate().map(row).collect()
}

#[test]
fn evaluators_agree_where_they_order_runs_alike() {
    let own = rows("own", &[1.0, 2.0, 3.0, 4.0, 5.0, 9.0]);
    let alike = rows("alike", &[10.0, 20.0, 30.0, 40.0, 50.0]);
    let contrary = rows("contrary", &[5.0, 4.0, 3.0, 2.0, 1.0]);
    let few = rows("few", &[1.0, 2.0, 3.0, 4.0]);
    let found = agreements(&own, &[alike, contrary, few]);
    let told = |one: &Ranks| {
        let fid = one.fid.expect("five runs");
        (one.of.clone(), fid.value, fid.n)
    };
    let told: Vec<(String, f64, usize)> = found.iter().map(told).collect();
    assert_eq!(told, [("alike".to_string(), 1.0, 5), ("contrary".to_string(), -1.0, 5)]);
    assert_eq!(found[1].first.map(|rank| rank.value), Some(-1.0));
}

fn points(law: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    [1e9, 1e10, 1e11, 1e12].map(|c| (c, law(c / 1e9))).to_vec()
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-5
}

#[test]
fn a_law_with_a_floor_is_found_where_there_is_one() {
    let points = points(|c| 0.05 + 0.4 * c.powf(-0.5));
    let law = FidLaw::of("masked", &points).unwrap();
    let Curve { floor, coefficient, exponent } = law.curve;
    assert!(near(floor, 0.05) && near(coefficient, 0.4) && near(exponent, 0.5), "{law:?}");
    assert!(law.exponent_range.into_iter().all(|exponent| near(exponent, 0.5)), "{law:?}");
    assert_eq!(FidLaw::of("masked", &points[..3]), None, "three numbers fit three budgets");
}

#[test]
fn a_floor_is_never_below_zero() {
    let points = points(|c| 0.3 - 0.04 * c.ln());
    let law = FidLaw::of("masked", &points[..]).unwrap();
    assert!(law.curve.floor == 0.0 && law.curve.exponent > 0.0, "{law:?}");
}

#[test]
fn fid_that_rises_has_no_law() {
    assert_eq!(FidLaw::of("masked", &points(|c| 0.1 * c.powf(0.2))), None);
}

#[test]
fn a_law_that_hangs_on_one_budget_says_so() {
    let mut points = points(|c| 0.05 + 0.4 * c.powf(-0.5));
    points[3].1 += 0.03;
    let [least, largest] = FidLaw::of("masked", &points).unwrap().exponent_range;
    assert!(largest / least > 1.5, "{least} to {largest}");
}

#[test]
fn what_orders_budgets_may_not_order_the_runs_of_one() {
    let of = |budget: f64| {
        (0..5).map(move |i| {
            row(
                10f64.powf(budget),
                16,
                -10.0 * budget - f64::from(i),
                9.0 - 2.0 * budget + 0.1 * f64::from(i),
            )
        })
    };
    let rows: Vec<Quality> = [1.0, 2.0, 3.0].into_iter().flat_map(of).collect();
    let fid = |ranks: &[Ranks]| ranks[0].fid.expect("five runs").value;
    let within = loss_ranks(&rows, |row| row.run.planned.budget_flops.to_bits());
    assert_eq!(fid(&within), -1.0);
    assert!(fid(&loss_ranks(&rows, |_| 0)) > 0.7);
}

fn row(budget_flops: f64, n_vocab: usize, loss: f64, fid: f64) -> Quality {
    let generator = Some("masked".to_string());
    let planned = Planned { budget_flops, n_vocab, generator, ..Planned::default() };
    let metrics: Metrics = [("loss_normalised", loss)].into_iter().collect();
    let fid = Repeated { mean: fid, half_width: 0.0, repeats: 2 };
    Quality {
        run: RunRecord::new(planned, Measured::default(), metrics),
        evaluator_id: String::new(),
        guidance: 0.0,
        scores: vec![("fid", Some(fid))],
    }
}

#[test]
fn the_best_by_loss_need_not_be_the_best_by_fid() {
    let rows = [row(1e9, 16, -1.0, 0.5), row(1e9, 64, -2.0, 0.7), row(1e10, 16, -3.0, 0.1)];
    let best = best(&rows);
    let of = |best: &Best| (best.budget_flops, best.by_loss.n_vocab, best.by_fid.n_vocab);
    assert_eq!(best.iter().map(of).collect::<Vec<_>>(), [(1e9, 64, 16), (1e10, 16, 16)]);
}
