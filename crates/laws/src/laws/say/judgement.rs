//! Sentences on how reliable a fit is: doubts, remedies and the verdict.

use super::flags_text;
use crate::laws::file::{Doubt, Exponent, Inside, LawKind, Laws, Validated};
use crate::laws::input::{Metric, PerQuantity};
use crate::laws::minima::Minimum;
use crate::laws::ranking::{Recommended, Score};
use crate::laws::text::{count, short};

/// All doubts, the heaviest first.
pub(in crate::laws) fn doubts(
    laws: &Laws,
    exponents: &PerQuantity<Exponent>,
    undetermined: &[(&str, Undetermined)],
) -> Vec<Doubt> {
    let missed = laws.judgement.validations.iter().filter_map(missed);
    rows(laws)
        .chain(missed)
        .chain(of_exponents(undetermined))
        .chain(implausible(exponents))
        .chain(untested(laws))
        .chain(no_intervals(laws))
        .chain(disagreement(laws, exponents))
        .chain(minima(laws))
        .chain(misfit(laws))
        .collect()
}

/// Faults of the rows, and results that depend on few of them.
fn rows(laws: &Laws) -> impl Iterator<Item = Doubt> {
    let doubt = |kind: &'static str| {
        move |said: &String| Doubt::new(kind, said.trim_end_matches('.').to_string(), "")
    };
    let parametric = laws.parametric.iter().flat_map(|own| &own.warnings);
    laws.judgement.rows.iter().map(doubt("rows")).chain(parametric.map(doubt("parametric")))
}

/// A forecast that missed.
fn missed(one: &Validated) -> Option<Doubt> {
    let sentence = one.sentence().filter(|_| !one.inside.is_whole())?;
    let what = sentence.trim_end_matches('.').to_string();
    Some(Doubt::new("forecast", what, "fit these runs too, by --validations"))
}

/// Exponents that are not determined, grouped by reason.
fn of_exponents(all: &[(&str, Undetermined)]) -> Vec<Doubt> {
    let of = |same: &[(&str, Undetermined)]| {
        let names: Vec<&str> = same.iter().map(|(name, _)| *name).collect();
        let (names, why) = (names.join(", "), same[0].1);
        let what = format!("The exponent of {names} is not determined: {}", why.sentence());
        Doubt::new("not-determined", what, why.remedy())
    };
    all.chunk_by(|a, b| a.1 == b.1).map(of).collect()
}

/// Exponents that no optimum has: N or D would fall as the budget grows.
fn implausible(exponents: &PerQuantity<Exponent>) -> Option<Doubt> {
    let is_out = |x: &f64| !(0.0..=1.0).contains(x);
    let size_or_data = exponents.named().filter(|(name, _)| ["N", "N_nv", "D"].contains(name));
    let told = size_or_data.filter_map(|(name, own)| Some((name, own.value.filter(is_out)?)));
    let told: Vec<String> = told.map(|(name, value)| format!("{name} {value:.3}")).collect();
    (!told.is_empty()).then(|| {
        let what = format!(
            "Exponents below 0 or above 1 are those of no optimum ({}): N or D would fall as C grows",
            told.join(", ")
        );
        Doubt::new("implausible", what, "check --columns, and add budgets")
    })
}

/// A law that no held-out budget has tested.
fn untested(laws: &Laws) -> Option<Doubt> {
    let own = laws.judgement.recommended.as_ref()?;
    own.scores.is_empty().then(|| {
        Doubt::new("untested", format!("Law not tested: {}", own.why), "add a larger budget")
    })
}

/// Laws of a grid whose run noise is unknown.
fn no_intervals(laws: &Laws) -> Option<Doubt> {
    let none = laws.law == LawKind::Isoflop && laws.noise.is_none();
    none.then(|| {
        // Those of the joint law come from its own misses.
        let of = if laws.judgement.joint.is_some() { "Minima have" } else { "There are" };
        let what = format!("{of} no intervals: the noise of single runs is not known");
        Doubt::new("no-intervals", what, "run every cell with a second seed, or add sizes")
    })
}

/// Two exponents of one quantity further apart than this, each outside the other's interval, disagree.
const DISAGREEMENT: f64 = 0.1;

/// Exponents on which the joint law and the laws through minima contradict each other.
fn disagreement(laws: &Laws, exponents: &PerQuantity<Exponent>) -> Option<Doubt> {
    let far = |name: &str, own: &Exponent| {
        let minima = laws.power_laws.of(name)?;
        let (value, [low, high]) = (own.value?, own.ci95?);
        let [least, most] = minima.exponent_ci95?;
        let outside = !(low..=high).contains(&minima.exponent) && !(least..=most).contains(&value);
        let far = outside && (value - minima.exponent).abs() > DISAGREEMENT;
        far.then(|| format!("{name} {value:.3} and {:.3}", minima.exponent))
    };
    let told = exponents.named().filter_map(|(name, own)| far(name, own));
    let told: Vec<String> = told.filter(|_| laws.recommended_law().is_joint()).collect();
    let what = format!(
        "The exponents by the joint law and by the minima contradict each other: {}",
        told.join(", ")
    );
    let remedy = "quote neither alone; add seeds, or sizes on both sides of each minimum";
    (!told.is_empty()).then(|| Doubt::new("disagreement", what, remedy))
}

/// Flagged minima: left out, or used despite the flag. Only if the law goes through minima.
fn minima(laws: &Laws) -> Option<Doubt> {
    let own: Vec<&Minimum> = laws.own_minima().collect();
    let flagged: Vec<&Minimum> = own.iter().copied().filter(|m| !m.flags.is_empty()).collect();
    if flagged.is_empty() || laws.law != LawKind::Isoflop {
        return None;
    }
    let used = |m: &Minimum| laws.fitted_budgets.contains(&m.budget_flops);
    let n_used = flagged.iter().filter(|m| used(m)).count();
    let named = |m: &&Minimum| {
        let so = if used(m) { "" } else { "; left out" };
        format!("{} ({}{so})", count(m.budget_flops), flags_text(&m.flags))
    };
    let (n, all) = (flagged.len(), own.len());
    let every = if n == all {
        format!("All {all} minima are flagged")
    } else {
        format!("{n} of {all} minima {} flagged", if n == 1 { "is" } else { "are" })
    };
    let what = match n {
        1..=3 => format!("{every}: {}", flagged.iter().map(named).collect::<Vec<_>>().join(", ")),
        _ if n_used == 0 => format!("{every} and left out (--full names them)"),
        _ if n_used == n => {
            format!("{every} but used, since fewer than three others remain (--full names them)")
        }
        _ => format!("{every}, {n_used} of them used (--full names them)"),
    };
    Some(Doubt::new("minima", what, ""))
}

/// The lack of fit of the curves, if the law goes through their minima.
fn misfit(laws: &Laws) -> Option<Doubt> {
    if laws.recommended_law().is_joint() {
        return None;
    }
    let lack = laws.judgement.lack_of_fit.iter().find(|lack| lack.method == laws.minima_method);
    let lack = lack.filter(|lack| lack.is_misfit())?;
    let p =
        if lack.p < 1e-4 { "below 1e-4".to_string() } else { format!("= {}", short(lack.p, 1)) };
    let what = format!(
        "The curves miss the runs by more than noise (chi2 {:.0} on {} degrees of freedom, p {p}); the intervals count this as noise",
        lack.chi2, lack.dof
    );
    Some(Doubt::new("misfit", what, ""))
}

/// How reliable a fit is, in one line.
pub(in crate::laws) fn verdict(laws: &Laws, is_determined: bool, doubts: &[Doubt]) -> String {
    if !is_determined {
        return "No exponent is determined by these runs.".to_string();
    }
    let tested = match laws.judgement.recommended.as_ref() {
        Some(Recommended { scores, .. }) if !scores.is_empty() => {
            let forecasts = match scores[0].compared().count() {
                1 => "one held-out forecast".to_string(),
                n => format!("{n} held-out forecasts"),
            };
            format!("Tested by {forecasts}: r.m.s. error {:.4}.", scores[0].rms)
        }
        Some(_) => "Not tested by any held-out budget.".to_string(),
        None => "Fitted to all runs at once; not tested by held-out budgets.".to_string(),
    };
    let doubts = match doubts.len() {
        0 => "No doubts.".to_string(),
        1 => "One doubt below.".to_string(),
        n => format!("{n} doubts below."),
    };
    format!("{tested} {doubts}")
}

impl Doubt {
    fn new(kind: &str, what: String, remedy: &str) -> Self {
        Self { kind: kind.to_string(), what, remedy: remedy.to_string() }
    }

    /// The doubt with its remedy, for a person.
    pub fn sentence(&self) -> String {
        match self.remedy.as_str() {
            "" => format!("{}.", self.what),
            remedy => format!("{}: {remedy}.", self.what),
        }
    }
}

// Why an exponent is not determined, and why a law is recommended.

/// Why an exponent is not determined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) enum Undetermined {
    /// Fewer than three budgets have a minimum.
    FewMinima,
    OneVocabulary,
    /// The losses do not depend on V beyond chance.
    NoVocabulary,
    /// The law has no optimum at one of the budgets.
    NoOptimum,
    /// The optimum lies far beyond the sizes tried.
    BeyondSizes(Beyond),
    /// The optimum lies far beyond the vocabularies tried.
    BeyondVocabularies(Beyond),
    /// The best exponent, whose interval is too wide.
    Wide(f64, [f64; 2]),
}

/// An optimum, and the nearest value tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::laws) struct Beyond {
    pub optimum: f64,
    pub tried: f64,
}

impl Undetermined {
    pub fn sentence(self) -> String {
        match self {
            Self::FewMinima => "fewer than three budgets have a minimum".into(),
            Self::OneVocabulary => "one vocabulary was tried".into(),
            Self::NoVocabulary => "the losses depend on V no more than by chance".into(),
            Self::NoOptimum => "the law has no optimum".into(),
            Self::BeyondSizes(beyond) => beyond.sentence("size"),
            Self::BeyondVocabularies(beyond) => beyond.sentence("vocabulary"),
            Self::Wide(best, [low, high]) => {
                format!("{best:.2} fits best, but anything from {low:.2} to {high:.2} fits too")
            }
        }
    }

    /// Runs to add so that the exponent is determined.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::OneVocabulary => "add vocabularies",
            Self::NoVocabulary => "add vocabularies further apart, or seeds",
            Self::BeyondVocabularies(_) => "add vocabularies on that side",
            Self::BeyondSizes(_) => "add sizes on that side",
            Self::FewMinima | Self::NoOptimum | Self::Wide(..) => {
                "add budgets, or sizes on both sides of each minimum"
            }
        }
    }
}

/// Smaller numbers are written without an exponent.
const WRITTEN_OUT: f64 = 1e5;

impl Beyond {
    fn sentence(self, what: &str) -> String {
        let side = if self.optimum < self.tried { "smallest" } else { "largest" };
        // A vocabulary is a whole number.
        let number = |x: f64| if x < WRITTEN_OUT { format!("{x:.0}") } else { count(x) };
        format!(
            "the optimum, {}, lies far beyond the {side} {what} tried, {}",
            number(self.optimum),
            number(self.tried)
        )
    }
}

/// Why the first of some scores is that of the law to believe, of `budgets` budgets and losses of a metric.
pub(in crate::laws) fn why_recommended(
    scores: &[Score],
    budgets: usize,
    metric: &Metric,
) -> String {
    match scores {
        [] => format!("no law could be tested ({budgets} budgets)"),
        [_] => "no other law could be tested".to_string(),
        [best, .., worst] => format!(
            "fitted to smaller budgets, it missed the losses of larger ones by {} (root mean square of {}), \
             {} by {:.4}",
            metric.said(&format!("{:.4}", best.rms)),
            best.compared().count(),
            worst.law.about(),
            worst.rms
        ),
    }
}

// Forecasts that runs have tested.

impl Validated {
    /// Forecast against measurement, in a sentence; `None` within the fit, or if no loss was forecast.
    pub fn sentence(&self) -> Option<String> {
        let is_forecast = self.extrapolation_factor > 1.0;
        let (loss, [low, high]) =
            (self.predicted.loss.filter(|_| is_forecast)?, self.predicted.loss_ci95?);
        let verdict = match self.inside.loss {
            Some(true) => "held",
            Some(false) => "MISSED",
            None => "is within the noise of its runs",
        };
        Some(format!(
            "A forecast for {} FLOPs {verdict}: L_u {loss:.3} (95 %: {low:.3} to {high:.3}), and the best of {} runs measured {:.3}{}.",
            count(self.budget_flops),
            self.measured.runs,
            self.measured.loss,
            outside(&self.inside)
        ))
    }
}

/// The quantities of the optimum that lie outside their intervals, as the end of a sentence; empty if none do.
fn outside(inside: &Inside) -> String {
    match &inside.outside().collect::<Vec<_>>()[..] {
        [] => String::new(),
        [one] => format!("; its {one} lies outside"),
        all => format!("; its {} lie outside", all.join(" and ")),
    }
}
