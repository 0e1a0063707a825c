//! Scored runs of a sweep: their table, their figure, and whether loss predicts quality within budgets and across.

use super::prelude::*;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::laws::{floor_law, power_law};
use isoflop::record::{Quality, write_scores};
use isoflop::scores::{RankCorrelation, rank_correlation};
use isoflop::spec::ScoresSpec;
use std::collections::HashMap;

/// The results of scored runs.
pub struct Scored {
    pub document: Value,
    pub text: String,
}

impl Scored {
    /// Writes the table and the figure of scored runs; `None` if no run is scored.
    pub fn of(
        sweep: &Sweep,
        folder: &ResultsFolder,
        records: &[RunRecord],
        output: &Output,
    ) -> Result<Option<Self>> {
        let (rows, by_others) = scored_rows(sweep, folder, records, output)?;
        if rows.is_empty() {
            return Ok(None);
        }
        write_scores(folder.root(), &rows)?;
        let drawing = figures::quality(&folder.name(), &rows);
        let drawn = draw_alone("quality", drawing, &folder.file("figures"), &Format::ALL);
        let figures = drawn.unwrap_or_else(|error| {
            output.warn(&error.to_string());
            Vec::new()
        });
        let within = loss_ranks(&rows, |row| row.run.planned.budget_flops.to_bits());
        let (across, best) = (loss_ranks(&rows, |_| 0), best(&rows));
        let laws = fid_laws(&best);
        let agreements = agreements(&rows, &by_others);
        let text = text(folder, &rows, [&within, &across, &agreements], (&best, &laws));
        let named = |key: &str, all: &[Ranks]| -> Vec<Value> {
            let one =
                |own: &Ranks| json!({ key: own.of, "fid": own.fid, "r_precision_1": own.first });
            all.iter().map(one).collect()
        };
        let document = json!({
            "runs": rows.len(), "evaluator_id": rows[0].evaluator_id,
            "ranks_within_budgets": named("generator", &within), "ranks": named("generator", &across),
            "agreement": named("evaluator_id", &agreements),
            "best": best, "fid_laws": laws, "figures": figures,
        });
        Ok(Some(Self { document, text }))
    }
}

// [`Ranks`]: rank correlations of two measures.

/// Rank correlation with FID and with R@1; `None` below five runs.
struct Ranks {
    /// The generator of the runs, or the other evaluator.
    of: String,
    fid: Option<RankCorrelation>,
    first: Option<RankCorrelation>,
}

impl Ranks {
    /// From the pairs of values of each run after the key of its group, by the name of a score.
    fn new(of: &str, pairs: impl Fn(&str) -> Vec<(u64, (f64, f64))>) -> Self {
        let [fid, first] = ["fid", "r_precision_1"].map(|name| rank_correlation(pairs(name)).ok());
        Self { of: of.to_string(), fid, first }
    }
}

/// Rank correlation of loss and scores within each generator, and within the groups of its runs. Losses of different
/// generators are not compared: the loss of a masked one is a bound.
fn loss_ranks(rows: &[Quality], group: impl Fn(&Quality) -> u64) -> Vec<Ranks> {
    let mut by_generator: BTreeMap<&str, Vec<&Quality>> = BTreeMap::new();
    rows.iter().for_each(|row| by_generator.entry(row.generator()).or_default().push(row));
    let ranks = |(generator, own): (&str, Vec<&Quality>)| {
        let pair = |row: &Quality, name: &str| {
            Some((group(row), (row.run.loss_normalised().ok()?, row.mean(name)?)))
        };
        Ranks::new(generator, |name| own.iter().filter_map(|row| pair(row, name)).collect())
    };
    by_generator.into_iter().map(ranks).collect()
}

/// Rank correlation of the sweep's evaluator with each other one that scored five runs or more.
fn agreements(own: &[Quality], by_others: &[Vec<Quality>]) -> Vec<Ranks> {
    let with = |others: &Vec<Quality>| {
        let id = |row: &Quality| row.run.planned.run_id.clone();
        let by_run: HashMap<String, &Quality> = others.iter().map(|row| (id(row), row)).collect();
        let pair = |row: &Quality, name: &str| {
            Some((0, (row.mean(name)?, by_run.get(&id(row))?.mean(name)?)))
        };
        let pairs = |name: &str| own.iter().filter_map(|row| pair(row, name)).collect();
        let ranks = Ranks::new(&others.first()?.evaluator_id, pairs);
        (ranks.fid.is_some() && ranks.first.is_some()).then_some(ranks)
    };
    by_others.iter().filter_map(with).collect()
}

// Scored runs as text.

/// Runs by FID, the best of each budget, laws and rank correlations.
fn text(
    folder: &ResultsFolder,
    rows: &[Quality],
    [within, across, agreements]: [&[Ranks]; 3],
    (best, laws): (&[Best], &[FidLaw]),
) -> String {
    let row = |row: &Quality| {
        let planned = &row.run.planned;
        let [codes, size] = [planned.n_vocab, planned.params_nonvocab].map(|n| n.to_string());
        let budget = format!("{:.1e}", planned.budget_flops);
        let loss = dash(row.run.loss_normalised().ok(), |loss| format!("{loss:.3}"));
        let fid = with_interval(row, "fid", 4);
        let first = dash(row.mean("r_precision_1"), |first| format!("{first:.3}"));
        let [skate, jerk] = ["foot_skate", "jerk"].map(|name| moving(row, name));
        [row.generator().to_string(), codes, size, budget, loss, fid, first, skate, jerk]
    };
    let heads = ["<scored runs", "V", "N_nv", "C", "L_u", "<FID", "R@1", "skate", "jerk"];
    let mut text = listed(heads, rows.iter().map(row));
    let truth = with_interval(&rows[0], "truth_r_precision_1", 3);
    let [skate, jerk] = ["truth_foot_skate", "truth_jerk"].map(|name| moving(&rows[0], name));
    let _ = writeln!(
        text,
        "true motions: R@1 {truth}, skate {skate} %, jerk {jerk} m/s³\n\
         means and 95 % intervals of repeats; skate: % of steps in which a foot slides"
    );
    text += &of_budgets(best);
    laws.iter().for_each(|law| text += &of_law(law));
    text += &of_ranks("<rank correlation with L_u within budgets", within);
    text += &of_ranks("<across budgets", across);
    text += &of_ranks("<with those by evaluator", agreements);
    let root = folder.root().display();
    let evaluator = &rows[0].evaluator_id;
    let _ = writeln!(text, "{root}/scores.parquet, {root}/figures/quality.svg");
    let loaded = folder.gates(evaluator).ok().flatten().and_then(|report| report.spec.loaded);
    let name = loaded.map_or_else(String::new, |loaded| format!(" (`{}`)", loaded.name));
    text + &format!("comparable only with scores of the same evaluator, {evaluator}{name}")
}

/// A law, and its range as budgets are left out one at a time.
fn of_law(law: &FidLaw) -> String {
    let FidLaw { generator, reference_flops, curve, floor_range, exponent_range, budgets } = law;
    let Curve { floor, coefficient, exponent } = curve;
    let ([least, most], [slowest, fastest]) = (floor_range, exponent_range);
    let curve = format!("{floor:.3} + {coefficient:.3} (C / {reference_flops:.0e})^-{exponent:.2}");
    format!(
        "FID of {generator}: {curve}, {budgets} budgets;\n  one left out: floor {least:.3} to {most:.3}, \
         exponent {slowest:.2} to {fastest:.2}\n"
    )
}

/// A table of rank correlations under a title; without generators that have too few runs.
fn of_ranks(title: &str, all: &[Ranks]) -> String {
    let known: Vec<&Ranks> = all.iter().filter(|own| own.fid.is_some()).collect();
    if known.is_empty() {
        return String::new();
    }
    let shown = |rank: Option<RankCorrelation>| {
        dash(rank, |RankCorrelation { value, interval: [low, high], .. }| {
            format!("{value:.2} ({low:.2} to {high:.2})")
        })
    };
    let row = |own: &Ranks| [own.of.clone(), shown(own.fid), shown(own.first)];
    table([title, "<FID", "<R@1"], known.into_iter().map(row))
}

/// The best run of each budget by loss, and by FID.
fn of_budgets(best: &[Best]) -> String {
    let cell = |Cell { params_nonvocab, n_vocab, fid, .. }: &Cell| {
        [params_nonvocab.to_string(), n_vocab.to_string(), format!("{fid:.4}")]
    };
    let row = |Best { generator, budget_flops, by_loss, by_fid }: &Best| {
        let ([size, codes, fid], [size_by, codes_by, fid_by]) = (cell(by_loss), cell(by_fid));
        let budget = format!("{budget_flops:.1e}");
        [generator.clone(), budget, size, codes, fid, size_by, codes_by, fid_by]
    };
    let heads = ["<best", "C", "L_u:N_nv", "V", "FID", "FID:N_nv", "V", "FID"];
    format!("\n{}\n", listed(heads, best.iter().map(row)))
}

/// Foot skate in percent, or jerk.
fn moving(row: &Quality, name: &str) -> String {
    dash(row.mean(name), |value| match name.ends_with("jerk") {
        true => format!("{value:.0}"),
        false => format!("{:.1}", 100.0 * value),
    })
}

fn with_interval(row: &Quality, name: &str, digits: usize) -> String {
    let score = row.scores.iter().find(|(own, _)| *own == name).and_then(|(_, score)| *score);
    dash(score, |score| score.shown(digits))
}

// The law of the best FID of a generator in compute.

/// Least number of budgets: one more than the law's three numbers.
const LEAST_BUDGETS: usize = 4;

/// FID = floor + coefficient (C / C0)^−exponent, and its dependence on single budgets.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct FidLaw {
    pub generator: String,
    /// C0.
    pub reference_flops: f64,
    #[serde(flatten)]
    pub curve: Curve,
    /// Least and largest floor of the laws that leave one budget out.
    pub floor_range: [f64; 2],
    /// Least and largest exponent of these laws.
    pub exponent_range: [f64; 2],
    pub budgets: usize,
}

/// The three numbers of a law.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Curve {
    /// A distance is never below 0, so neither is the floor.
    pub floor: f64,
    pub coefficient: f64,
    pub exponent: f64,
}

/// The law of each generator with at least four budgets whose best FID falls with C.
fn fid_laws(best: &[Best]) -> Vec<FidLaw> {
    let mut by_generator: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for best in best {
        let point = (best.budget_flops, best.by_fid.fid);
        by_generator.entry(&best.generator).or_default().push(point);
    }
    let law = |(generator, points): (&str, Vec<(f64, f64)>)| FidLaw::of(generator, &points);
    by_generator.into_iter().filter_map(law).collect()
}

impl FidLaw {
    fn of(generator: &str, points: &[(f64, f64)]) -> Option<Self> {
        let reference_flops = points.first().filter(|_| points.len() >= LEAST_BUDGETS)?.0;
        let curve = Curve::of(points, reference_flops)?;
        let without = |left_out: usize| {
            let rest = points.iter().enumerate().filter(|(i, _)| *i != left_out);
            Curve::of(&rest.map(|(_, point)| *point).collect::<Vec<_>>(), reference_flops)
        };
        let others: Vec<Curve> = (0..points.len()).filter_map(without).collect();
        let range = |of: fn(&Curve) -> f64| {
            let values = others.iter().map(of);
            let least = values.clone().fold(of(&curve), f64::min);
            [least, values.fold(of(&curve), f64::max)]
        };
        Some(Self {
            generator: generator.to_string(),
            reference_flops,
            curve,
            floor_range: range(|curve| curve.floor),
            exponent_range: range(|curve| curve.exponent),
            budgets: points.len(),
        })
    }
}

impl Curve {
    /// Least squares; the power law without a floor if the floor would be below 0 or is not seen.
    fn of(points: &[(f64, f64)], reference: f64) -> Option<Self> {
        let (compute, fid): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
        if let Some(law) =
            floor_law(&compute, &fid, reference).filter(|law| law.floor > 0.0 && !law.is_at_bound())
        {
            let (floor, coefficient) = (law.floor, law.coefficient);
            return Some(Self { floor, coefficient, exponent: law.exponent });
        }
        if fid.iter().any(|fid| *fid <= 0.0) {
            return None;
        }
        let law = power_law(&compute, &fid, reference, &vec![1.0; fid.len()], None)?;
        let falls = law.exponent < 0.0;
        falls.then(|| Self {
            floor: 0.0,
            coefficient: law.ln_at_reference.exp(),
            exponent: -law.exponent,
        })
    }
}

// The best run of each budget, by loss and by scores.

/// The best runs of a generator at a budget.
#[derive(Clone, Debug, Serialize)]
struct Best {
    pub generator: String,
    pub budget_flops: f64,
    pub by_loss: Cell,
    pub by_fid: Cell,
}

/// A scored run.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Cell {
    pub params_nonvocab: usize,
    pub n_vocab: usize,
    pub loss_normalised: f64,
    pub fid: f64,
}

/// The best runs of each generator and budget, sorted by both.
fn best(rows: &[Quality]) -> Vec<Best> {
    let mut cells: BTreeMap<(&str, u64), Vec<Cell>> = BTreeMap::new();
    for row in rows {
        let budget = row.run.planned.budget_flops;
        if let Some(cell) = Cell::of(row) {
            // Positive numbers are ordered like their bits.
            cells.entry((row.generator(), budget.to_bits())).or_default().push(cell);
        }
    }
    let least = |cells: &[Cell], of: fn(&Cell) -> f64| {
        cells.iter().min_by(|a, b| of(a).total_cmp(&of(b))).expect("a cell of each").clone()
    };
    let best = |((generator, budget), cells): ((&str, u64), Vec<Cell>)| Best {
        generator: generator.to_string(),
        budget_flops: f64::from_bits(budget),
        by_loss: least(&cells, |cell| cell.loss_normalised),
        by_fid: least(&cells, |cell| cell.fid),
    };
    cells.into_iter().map(best).collect()
}

impl Cell {
    fn of(row: &Quality) -> Option<Self> {
        let planned = &row.run.planned;
        Some(Self {
            params_nonvocab: planned.params_nonvocab,
            n_vocab: planned.n_vocab,
            loss_normalised: row.run.loss_normalised().ok()?,
            fid: row.mean("fid")?,
        })
    }
}

// Scored runs, by the evaluator that scored them.

/// Scored runs of a folder, the best FID first: by the sweep's evaluator, and by each earlier one.
fn scored_rows(
    sweep: &Sweep,
    folder: &ResultsFolder,
    records: &[RunRecord],
    output: &Output,
) -> Result<(Vec<Quality>, Vec<Vec<Quality>>)> {
    // The folder also has scores under earlier settings.
    let wanted = sweep.scores.as_ref().map(ScoresSpec::of_a_run);
    let by_id: BTreeMap<&str, &RunRecord> =
        records.iter().map(|record| (record.planned.run_id.as_str(), record)).collect();
    let mut by_evaluator: BTreeMap<String, Vec<Quality>> = BTreeMap::new();
    for scores in folder.all_scores(|line| output.warn(&line))? {
        let record = by_id.get(scores.run_id.as_str());
        if let Some(record) = record.filter(|_| wanted.as_ref() == Some(&scores.spec)) {
            let row = scores.quality((*record).clone());
            by_evaluator.entry(row.evaluator_id.clone()).or_default().push(row);
        }
    }
    // The evaluators that the sweep describes.
    let present = match &sweep.evaluator {
        Some(section) => folder.gates_of(section, |line| output.warn(&line))?,
        None => Vec::new(),
    };
    let is_present = |id: &String| present.iter().any(|report| report.evaluator_id == *id);
    let candidates = by_evaluator.iter().filter(|(id, _)| is_present(id));
    let most = candidates.max_by_key(|(_, rows)| rows.len()).map(|(id, _)| id.clone());
    let mut own = most.and_then(|id| by_evaluator.remove(&id)).unwrap_or_default();
    let fid = |row: &Quality| row.mean("fid").unwrap_or(f64::INFINITY);
    own.sort_by(|a, b| fid(a).total_cmp(&fid(b)));
    Ok((own, by_evaluator.into_values().collect()))
}

#[cfg(test)]
mod tests;
