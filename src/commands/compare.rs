//! `isoflop compare`: the laws of several studies side by side, and the differences of their sweeps.

use super::args::budget;
use super::predict::{laws_named, predict_one};
use super::prelude::*;
use isoflop::figures::{self, Format, draw_alone};
use isoflop::laws::{Difference, Estimate, Exponent, LawKind, PerQuantity};
use isoflop::predict::PredictError;
use serde_yaml::Value;

#[derive(Args)]
pub struct CompareArgs {
    /// Sweeps' folders, laws.json files, or scamo; the others are compared with the first
    #[arg(required = true, num_args = 2.., value_name = "RESULTS")]
    studies: Vec<String>,
    /// The budget in FLOPs at which optima are compared; by default the largest one fitted
    #[arg(long, value_parser = budget)]
    budget: Option<f64>,
    /// The folder for the figure: compare.svg, .png and .pdf
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn compare(args: &CompareArgs, output: &Output) -> Result<Exit> {
    let studies: Vec<Study> =
        args.studies.iter().map(|name| Study::of(name)).collect::<Result<_>>()?;
    let rules: Vec<&str> = studies.iter().map(|study| study.laws.flops_rule.as_str()).collect();
    if rules.iter().any(|rule| *rule != rules[0]) {
        output.warn(&format!("FLOPs are counted by different rules: {}", rules.join(", ")));
    }
    let fitted = studies.iter().filter(|study| study.laws.law != LawKind::Published);
    let largest = fitted.map(|study| study.laws.range()[1]).fold(f64::NAN, f64::max);
    let budget = args.budget.or(Some(largest).filter(|budget| budget.is_finite()));
    let budget = budget.context("no study says which budgets it was fitted to; give --budget")?;
    let quantities = Quantity::all(&studies, budget)?;
    let sweeps = SweepDifference::of(&studies)?;
    let draw = |out: &Path| {
        let named: Vec<(&str, &Laws)> =
            studies.iter().map(|study| (&*study.name, &study.laws)).collect();
        draw_alone("compare", figures::compare(&named), out, &Format::ALL)
    };
    let figures = args.out.as_deref().map(draw).transpose()?;
    let document = json!({
        "studies": studies.iter().map(|study| &study.name).collect::<Vec<_>>(),
        "budget_flops": budget, "quantities": quantities, "sweeps": sweeps, "figures": figures,
    });
    output.result(&document, &text(&studies, budget, &quantities, &sweeps, output.full))?;
    figures.iter().flatten().for_each(|path| output.note(&path.display().to_string()));
    Ok(Exit::Done)
}

// The comparison as text.

/// Keys of sweeps that are listed, at most.
const KEYS: usize = 12;
/// Characters of a study's name that are shown.
const WIDEST: usize = 24;

/// Characters of a value that are shown.
const SHOWN: usize = 22;

fn text(
    studies: &[Study],
    budget: f64,
    quantities: &[Quantity],
    sweeps: &[SweepDifference],
    full: bool,
) -> String {
    let mut text = String::new();
    for quantity in quantities {
        let at = if quantity.is_ratio { format!(" at {budget:.3e} FLOPs") } else { String::new() };
        let _ = writeln!(text, "{}{at}", quantity.name);
        let row = |i: usize| {
            let name: String = studies[i].name.chars().take(WIDEST).collect();
            let difference = quantity.differences[i].map(|own| against(own, quantity.is_ratio));
            let estimate = dash(quantity.estimates[i], |found| said(found, quantity));
            [format!("  {name}"), estimate, difference.unwrap_or_default()]
        };
        text += &table(["<", "<", "<"], (0..studies.len()).map(row));
    }
    text += &of_sweeps(studies, sweeps, full);
    text
}

fn said(Estimate { value, ci95 }: Estimate, quantity: &Quantity) -> String {
    let number = |x: f64| match (quantity.name, quantity.is_ratio) {
        ("V", _) => format!("{x:.0}"),
        (_, true) => format!("{x:.2e}"),
        (_, false) => format!("{x:.3}"),
    };
    let interval = ci95.map(|[low, high]| format!(" {}..{}", number(low), number(high)));
    format!("{}{}", number(value), interval.unwrap_or_default())
}

/// A difference, and whether it is significant.
fn against(Difference { value, ci95, differs }: Difference, is_ratio: bool) -> String {
    let number = |x: f64| if is_ratio { format!("x{:.2}", x.exp()) } else { format!("{x:+.3}") };
    let Some([low, high]) = ci95 else { return number(value) };
    let verdict = if differs == Some(true) { "differs" } else { "" };
    format!("{} ({}..{}) {verdict}", number(value), number(low), number(high))
}

/// The length of the common prefix of all values.
fn alike(values: &[&str]) -> usize {
    let same = |i: usize| {
        let letter = values[0].chars().nth(i);
        letter.is_some() && values.iter().all(|value| value.chars().nth(i) == letter)
    };
    (0..).take_while(|i| same(*i)).count()
}

/// A long value, cut to begin a little before the first difference.
fn cut(value: &str, alike: usize) -> String {
    let n = value.chars().count();
    if n <= SHOWN {
        return value.to_string();
    }
    let first = alike.saturating_sub(SHOWN / 4);
    let shown: String = value.chars().skip(first).take(SHOWN).collect();
    let before = if first > 0 { "…" } else { "" };
    let after = if first + SHOWN < n { "…" } else { "" };
    format!("{before}{shown}{after}")
}

fn of_sweeps(studies: &[Study], sweeps: &[SweepDifference], full: bool) -> String {
    if sweeps.is_empty() {
        return String::new();
    }
    let mut text = String::from("\nsweeps differ in\n");
    let limit = if full { usize::MAX } else { KEYS };
    for SweepDifference { key, values } in sweeps.iter().take(limit) {
        let values: Vec<&str> =
            values.iter().map(|value| value.as_deref().unwrap_or("-")).collect();
        let alike = if full { 0 } else { alike(&values) };
        let shown = |value: &&str| if full { value.to_string() } else { cut(value, alike) };
        let values: Vec<String> = values.iter().map(shown).collect();
        let _ = writeln!(text, "  {key}: {}", values.join(" | "));
    }
    text += &more(sweeps.len(), limit, ": --full");
    let codes = sweeps.iter().any(|each| {
        ["data", "tokenizer"].contains(&each.key.split('.').next().unwrap_or_default())
    });
    if codes && studies.len() > 1 {
        text +=
            "Data or tokenizers differ, so L_u is of each study's own codes and is not compared.\n";
    }
    text
}

// Differences between the sweeps of studies.

/// A key whose values differ: one value per study, `None` if it has none.
#[derive(Debug, PartialEq, Eq, Serialize)]
struct SweepDifference {
    pub key: String,
    pub values: Vec<Option<String>>,
}

impl SweepDifference {
    /// The differences of the frozen sweeps in folders; empty if a folder has none.
    pub fn of(studies: &[Study]) -> Result<Vec<Self>> {
        let mut all: Vec<BTreeMap<String, String>> = Vec::new();
        for study in studies {
            // A laws.json stands for no folder.
            if !study.path.is_dir() {
                return Ok(Vec::new());
            }
            let path = study.path.join("sweep.yaml");
            let Some(text) = read_yaml_if_there(&path)? else { return Ok(Vec::new()) };
            let value = serde_yaml::from_str(&text).map_err(|e| FileError::damaged(&path, e))?;
            let mut keys = BTreeMap::new();
            flatten("", &value, &mut keys);
            all.push(keys);
        }
        Ok(differences(&all))
    }
}

fn differences(all: &[BTreeMap<String, String>]) -> Vec<SweepDifference> {
    let keys: std::collections::BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let difference = |key: &String| {
        let values: Vec<Option<String>> = all.iter().map(|keys| keys.get(key).cloned()).collect();
        let differs = values.iter().any(|value| *value != values[0]);
        differs.then(|| SweepDifference { key: key.clone(), values })
    };
    keys.into_iter().filter_map(difference).collect()
}

/// Keys with dots; a list is one value.
fn flatten(key: &str, value: &Value, keys: &mut BTreeMap<String, String>) {
    let Value::Mapping(mapping) = value else {
        let text = serde_json::to_string(value).unwrap_or_default();
        keys.insert(key.to_string(), text);
        return;
    };
    for (name, value) in mapping {
        let name = name.as_str().unwrap_or_default();
        let key = if key.is_empty() { name.to_string() } else { format!("{key}.{name}") };
        flatten(&key, value, keys);
    }
}

// The compared quantities: exponents, and optima at a budget.

/// A quantity of every study.
#[derive(Serialize)]
struct Quantity {
    pub name: &'static str,
    /// Whether differences are ratios.
    pub is_ratio: bool,
    /// `None` if a study does not have it.
    pub estimates: Vec<Option<Estimate>>,
    /// Each study minus the first, in logarithms for ratios; `None` for the first.
    pub differences: Vec<Option<Difference>>,
}

/// The exponents of the recommended law that `isoflop fit` prints, and their symbols.
const EXPONENTS: [(&str, &str); 4] = [
    ("exponent of N_nv in C", "N_nv"),
    ("exponent of N_v in C", "N_v"),
    ("exponent of N in C", "N"),
    ("exponent of D in C", "D"),
];
/// The compared quantities of an optimum.
const OPTIMA: [&str; 5] = ["N_nv", "N_v", "N", "V", "D"];

impl Quantity {
    /// All quantities that some study has.
    pub fn all(studies: &[Study], budget: f64) -> Result<Vec<Self>> {
        let optima = studies.iter().map(|study| predict_one(&study.laws, budget));
        let told = optima.map(|optimum| match optimum {
            Err(PredictError::NoOptimum { .. }) => Ok(None),
            other => other.map(Some),
        });
        let optima: Vec<Option<Prediction>> = told.collect::<Result<_, PredictError>>()?;
        let own: Vec<PerQuantity<Exponent>> =
            studies.iter().map(|study| study.laws.answer().exponents).collect();
        // `None` if it is not determined.
        let exponent = |Exponent { value, ci95, .. }: &Exponent| {
            Some(Estimate { value: (*value)?, ci95: *ci95 })
        };
        let of_laws = EXPONENTS.iter().map(|(name, symbol)| {
            Self::new(name, false, own.iter().map(|own| exponent(own.of(symbol)?)).collect())
        });
        let vocabularies = studies.iter().zip(&own);
        let vocabularies = vocabularies.map(|(study, own)| of_vocabulary(&study.laws, own));
        let of_laws =
            of_laws.chain([Self::new("exponent of N_v in N_nv", false, vocabularies.collect())]);
        let of_optima = OPTIMA.iter().map(|symbol| {
            let of = |found: &Prediction| {
                let ci95 = found.ci95.at.of(symbol).copied();
                Some(Estimate { value: *found.at.of(symbol)?, ci95 })
            };
            let estimates = optima.iter().map(|optimum| of(optimum.as_ref()?)).collect();
            Self::new(symbol, true, estimates)
        });
        let all = of_laws.chain(of_optima);
        Ok(all.filter(|quantity| quantity.estimates.iter().any(Option::is_some)).collect())
    }

    fn new(name: &'static str, is_ratio: bool, estimates: Vec<Option<Estimate>>) -> Self {
        let scaled = |estimate: Estimate| if is_ratio { estimate.ln() } else { estimate };
        let first = estimates[0].map(scaled);
        let less =
            |estimate: &Option<Estimate>| Some(Difference::of(estimate.map(scaled)?, first?));
        let others = estimates[1..].iter().map(less);
        let differences = [None].into_iter().chain(others).collect();
        Self { name, is_ratio, estimates, differences }
    }
}

/// The exponent of N_v in N_nv: for a joint law the ratio of two exponents, for others a law of its own.
fn of_vocabulary(laws: &Laws, own: &PerQuantity<Exponent>) -> Option<Estimate> {
    if laws.recommended_law().is_joint() {
        let [vocab, size] =
            [&own.params_vocab, &own.params_nonvocab].map(|own| own.as_ref()?.value);
        return Some(Estimate { value: vocab? / size?, ci95: None });
    }
    let law = laws.told_vocab_from_nonvocab()?;
    Some(Estimate { value: law.exponent, ci95: law.exponent_ci95 })
}

// [`Study`]: laws with a name.

/// A study by its name.
struct Study {
    pub name: String,
    /// The laws through all budgets.
    pub laws: Laws,
    pub path: PathBuf,
}

impl Study {
    /// Reads a folder, a file, or `scamo`.
    pub fn of(given: &str) -> Result<Self> {
        let path = PathBuf::from(given);
        let laws = laws_named(given)?;
        if laws.power_laws.tokens.is_none() {
            bail!("{given} holds no power laws to compare");
        }
        // A folder's name, or a file's without its ending; for `laws.json` the name of its folder.
        let stem = path.file_stem().unwrap_or_default();
        let folder = path.parent().and_then(Path::file_name).filter(|_| stem == "laws");
        let name = match path.is_dir() {
            true => ResultsFolder::new(&path).name(),
            false => folder.unwrap_or(stem).to_string_lossy().into_owned(),
        };
        Ok(Self { name, laws, path })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_differ_are_told_with_their_values() {
        let keys = |text: &str| {
            let mut keys = BTreeMap::new();
            flatten("", &serde_yaml::from_str(text).unwrap(), &mut keys);
            keys
        };
        let found = differences(&[
            keys("name: a\ngrid: {vocab: [1, 2], budgets: [1e9]}\ntrain: {lr: 1}"),
            keys("name: b\ngrid: {vocab: [1, 2], budgets: [2e9]}"),
        ]);
        let found: Vec<(&str, &Option<String>)> =
            found.iter().map(|each| (each.key.as_str(), &each.values[1])).collect();
        let value = |text: &str| Some(text.to_string());
        assert_eq!(
            found,
            [
                ("grid.budgets", &value("[2000000000.0]")),
                ("name", &value("\"b\"")),
                ("train.lr", &None)
            ]
        );
    }
}
