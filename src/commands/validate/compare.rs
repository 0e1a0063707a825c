//! Compares a forecast with the runs that test it.

use crate::commands::fit::points;
use crate::commands::prelude::*;
use isoflop::laws::{
    Inside, IsoFlopPoint, Measured, MinimumMethod, NoiseSource, Predicted, RunNoise, TriedCells,
    Validated, cross_optimum, minimum_at, tied_cells, times,
};
use isoflop::record::table as runs;
use std::collections::BTreeSet;

/// The forecast of some laws, and the best cell of the validation's folder.
pub fn compare(
    folder: &ResultsFolder,
    (laws, forecast): (&Laws, &Prediction),
    rule: FlopsRule,
) -> Result<Validated> {
    let records = runs::read(folder.root())?;
    let (points, left_out) = points(&records, rule);
    // The scatter of cells around a surface is the noise or more: it may include misfit.
    let is_of_runs = |noise: &RunNoise| !matches!(noise.source, NoiseSource::Surface { .. });
    let of_a_run = laws.noise.filter(is_of_runs).map(|noise| noise.sd);
    let measured =
        best(&points, of_a_run).context(left_out.unwrap_or_else(|| "no run is finished".into()))?;
    let measured = Measured { loss_nats: cross_entropy(&records, &points, &measured), ..measured };
    let ci = &forecast.ci95;
    let predicted = Predicted {
        loss: forecast.loss_normalised,
        loss_ci95: ci.loss_normalised,
        params_nonvocab: forecast.at.params_nonvocab,
        params_nonvocab_ci95: ci.at.params_nonvocab,
        params_vocab: forecast.at.params_vocab,
        params_vocab_ci95: ci.at.params_vocab,
        tokens: forecast.at.tokens,
        tokens_ci95: ci.at.tokens,
    };
    let at = (forecast.budget_flops, forecast.extrapolation_factor);
    Ok(Validated::new(at, predicted, measured))
}

/// The mean cross-entropy of the best cell's runs, if all have it.
fn cross_entropy(records: &[RunRecord], points: &[IsoFlopPoint], best: &Measured) -> Option<f64> {
    let is_best = |point: &&IsoFlopPoint| {
        (point.params_nonvocab, point.n_vocab) == (best.params_nonvocab, best.n_vocab)
    };
    let of = |point: &IsoFlopPoint| {
        let record = records.iter().find(|record| record.planned.run_id == point.run_id)?;
        record.metrics.get("loss_nats")
    };
    let losses: Option<Vec<f64>> = points.iter().filter(is_best).map(of).collect();
    losses.map(|losses| losses.iter().sum::<f64>() / losses.len() as f64)
}

/// The cell of the lowest mean loss.
fn best(points: &[IsoFlopPoint], of_a_run: Option<f64>) -> Option<Measured> {
    let best = minimum_at(MinimumMethod::Argmin, &points.iter().collect::<Vec<_>>())?;
    let distinct = |of: fn(&IsoFlopPoint) -> f64| {
        let bits: BTreeSet<u64> = points.iter().map(|point| of(point).to_bits()).collect();
        Some(bits.len())
    };
    Some(Measured {
        loss: best.loss_normalised,
        params_nonvocab: best.params_nonvocab,
        params_vocab: best.params_vocab,
        n_vocab: best.n_vocab,
        tokens: best.tokens,
        runs: points.len(),
        sizes: distinct(|point| point.params_nonvocab),
        vocabularies: distinct(|point| point.n_vocab),
        tried: Some(TriedCells {
            params_nonvocab: range(points, |point| point.params_nonvocab),
            params_vocab: range(points, |point| point.params_vocab),
        }),
        optimum: cross_optimum(points),
        tied: tied_cells(points, of_a_run),
        loss_nats: None,
    })
}

/// The smallest and the largest value.
fn range(points: &[IsoFlopPoint], of: fn(&IsoFlopPoint) -> f64) -> [f64; 2] {
    let values = || points.iter().map(of);
    [values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max)]
}

/// The comparison, one line per quantity.
pub fn text(validated: &Validated) -> String {
    let Validated { predicted, measured, inside, .. } = validated;
    let Inside { loss, params_nonvocab, params_vocab, tokens } = *inside;
    let size = (predicted.params_nonvocab, predicted.params_nonvocab_ci95);
    let vocab = (predicted.params_vocab, predicted.params_vocab_ci95);
    let [size_found, vocab_found, tokens_found] = measured.at();
    let rows = [
        ("L_u", (predicted.loss, predicted.loss_ci95), measured.loss, loss),
        ("N_nv", size, size_found, params_nonvocab),
        ("N_v", vocab, vocab_found, params_vocab),
        ("D", (predicted.tokens, predicted.tokens_ci95), tokens_found, tokens),
    ];
    let rows = rows.map(|(name, (value, interval), found, inside)| {
        let number = |x: f64| if name == "L_u" { format!("{x:.4}") } else { format!("{x:.3e}") };
        let lies_outside = interval.is_some_and(|[low, high]| !(low..=high).contains(&found));
        let verdict = match inside {
            Some(true) => "inside",
            Some(false) => "OUTSIDE",
            None if name == "N_v" && measured.vocabularies == Some(1) => "not varied",
            None if lies_outside => "a tie, within the noise of the runs",
            None if interval.is_some() => "could not have failed",
            None => "",
        };
        let interval = dash(interval, |[low, high]| format!("{}..{}", number(low), number(high)));
        [name.to_string(), dash(value, number), interval, number(found), verdict.to_string()]
    });
    let mut out = format!(
        "{:e} FLOPs, {} times beyond the fit, {} runs:\n{}",
        validated.budget_flops,
        times(validated.extrapolation_factor),
        measured.runs,
        table(["<", "forecast", "95 % interval", "measured", "<"], rows)
    );
    if let Some([forecast, found]) = validated.cross_entropy() {
        let off = |forecast: f64, found: f64| 100.0 * ((forecast - found) / found).abs();
        let of_loss = predicted.loss.map_or(f64::NAN, |loss| off(loss, measured.loss));
        out += &format!(
            "cross-entropy of the best cell: {forecast:.4} nats forecast, {found:.4} measured, {:.2} % off\n\
             (of L_u {of_loss:.2} %)\n",
            off(forecast, found)
        );
    }
    if measured.optimum.is_some() {
        out += &format!(
            "N_nv, N_v and D measured by parabolas through the cells;\nthe best cell has {:.3e}, {:.3e}, {:.3e}\n",
            measured.params_nonvocab, measured.params_vocab, measured.tokens
        );
    }
    out
}
