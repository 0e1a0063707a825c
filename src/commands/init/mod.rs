//! `isoflop init`: writes a sweep file for the user's data, sized to a time.

mod design;
use super::args::number;
use super::context::WorkArgs;
use super::doubts::{Doubt, doubts};
use super::prelude::*;
use design::Design;
use isoflop::data::{self, DataFacts};
use isoflop::jobs::speed::Speed;
use isoflop::jobs::{Job, all_jobs};
use isoflop::plan::{Plan, PlannedRun};
use isoflop::sweep;
use isoflop::units::quoted;

#[derive(Args)]
pub struct InitArgs {
    /// The sweep file to write, e.g. study.yaml
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A data set in the HumanML3D layout; by default the procedural motion
    #[arg(long, value_name = "DATA")]
    data: Option<PathBuf>,
    /// Hours that the sweep may take on this machine
    #[arg(long, default_value_t = 1.0, value_parser = hours)]
    hours: f64,
    #[command(flatten)]
    work: WorkArgs,
    /// Overwrite an existing file
    #[arg(long)]
    overwrite: bool,
}

fn hours(text: &str) -> Result<f64, String> {
    let what = "a time that a sweep takes: hours are above 0, and at most 10000";
    number(text, |hours| hours > 0.0 && hours <= 10_000.0, what)
}

/// Most passes over the data at the expected optimum of the largest budget.
const EPOCHS: f64 = 4.0;

pub fn init(args: &InitArgs, output: &Output) -> Result<Exit> {
    if args.file.exists() && !args.overwrite {
        bail!("{} is there already; give another file, or --overwrite", args.file.display());
    }
    let desk = Desk::open(args)?;
    let (offer, fresh_hours) = desk.largest()?;
    let text = desk.text(&offer.design);
    atomic::write_bytes(&args.file, text.as_bytes())?;
    desk.warnings(&offer, fresh_hours)?.iter().for_each(|line| output.warn(line));
    let Offer { hours, runs, .. } = offer;
    let Design { budgets, widths, vocab, seeds, tokenizer_seeds, .. } = &offer.design;
    let bound_by = "larger budgets take longer: raise --hours";
    let document = json!({
        "file": args.file, "hours": hours, "runs": runs, "budgets": budgets, "d_model": widths,
        "vocab": vocab, "seeds": seeds, "tokenizer_seeds": tokenizer_seeds, "bound_by": bound_by,
    });
    let file = quoted(&args.file.display().to_string());
    let said = format!(
        "{}: {runs} runs, about {} by a timing of this machine\n{bound_by}\nnext     isoflop run {file}",
        args.file.display(),
        duration(hours),
    );
    output.result(&document, &said)
}

fn duration(hours: f64) -> String {
    if hours < 1.0 { format!("{:.0} min", (hours * 60.0).ceil()) } else { format!("{hours:.1} h") }
}

/// Codes of the training split at four frames a code.
fn unique_tokens(facts: &DataFacts) -> usize {
    facts.train_frames() / 4
}

/// The inputs of sizing a sweep.
struct Desk<'a> {
    args: &'a InitArgs,
    name: String,
    /// Codes of the data set; `None` for the procedural motion, which is unlimited.
    facts: Option<DataFacts>,
}

impl<'a> Desk<'a> {
    fn open(args: &'a InitArgs) -> Result<Self> {
        let stem = args.file.file_stem().unwrap_or_default().to_string_lossy();
        let name: String =
            stem.chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        let mut desk = Self { args, name, facts: None };
        if args.data.is_some() {
            let sweep = sweep::parse("init", &desk.text(&Design::up_to(LEAST, None)), &[])?;
            let source = data::open(&sweep.data, None).context("opening the data")?;
            desk.facts = Some(DataFacts::of(&*source));
        }
        Ok(desk)
    }

    fn text(&self, design: &Design) -> String {
        design::text(&self.name, self.args.data.as_deref(), design)
    }

    /// Passes over the data at the expected optimum of the largest budget; `None` if the data are unlimited.
    fn epochs(&self, design: &Design) -> Option<f64> {
        let facts = self.facts.as_ref()?;
        Some(design.most_tokens() / unique_tokens(facts) as f64)
    }

    /// Warnings about an offer.
    fn warnings(&self, offer: &Offer, fresh_hours: Option<f64>) -> Result<Vec<String>> {
        let sweep = sweep::parse("init", &self.text(&offer.design), &[])?;
        let facts = self.facts.clone().unwrap_or_else(|| DataFacts::absent(String::new()));
        let plan = Plan::new(&sweep, facts);
        let mut warnings: Vec<String> = doubts(&sweep, &plan).iter().map(Doubt::sentence).collect();
        if let Some(epochs) = self.epochs(&offer.design).filter(|epochs| *epochs > EPOCHS) {
            let less = fresh_hours.map_or_else(String::new, |hours| {
                format!("; with --hours {hours} it is {EPOCHS} times at most")
            });
            warnings.push(format!(
                "the best run of the largest budget repeats the data about {epochs:.0} times, so the laws \
                 describe repeated data, not new data{less}"
            ));
        }
        if offer.hours > self.args.hours {
            let time = duration(offer.hours);
            warnings.push(format!("the smallest sweep that gives laws takes about {time}"));
        }
        Ok(warnings)
    }

    /// The largest sweep within the time, and, if it repeats the data, hours of one that does not.
    fn largest(&self) -> Result<(Offer, Option<f64>)> {
        let slots = self.args.work.slots();
        let speed = self.speed(slots)?;
        let price = |design: &Design| price(&self.text(design), &speed, slots);
        let terms = Terms {
            hours: self.args.hours,
            unique_tokens: self.facts.as_ref().map(unique_tokens),
            price: &price,
        };
        let offer = terms.largest()?;
        let repeats = self.epochs(&offer.design).is_some_and(|epochs| epochs > EPOCHS);
        let fresh_hours = if repeats { terms.fresh_hours()? } else { None };
        Ok((offer, fresh_hours))
    }

    /// The speed of this machine on the smallest and largest models of a sweep.
    fn speed(&self, slots: usize) -> Result<Speed> {
        let plan = |budget: f64| plan(&self.text(&Design::up_to(budget, None)));
        let plans = PROBED.into_iter().map(plan).collect::<Result<Vec<_>>>()?;
        let runs: Vec<&PlannedRun> = plans.iter().flat_map(|plan| &plan.runs).collect();
        Ok(Speed::measured(&runs, &self.args.work.device.open()?, slots, PROBES))
    }
}

/// Sizes that are measured: a wider range than in a plan.
const PROBES: usize = 10;
/// Largest budgets of the sweeps whose models are probed.
const PROBED: [f64; 3] = [LEAST, 1e12, 1e14];

/// A sweep's plan; its cost does not depend on the data.
fn plan(text: &str) -> Result<Plan> {
    let sweep = sweep::parse("init", text, &[])?;
    Ok(Plan::new(&sweep, DataFacts::absent(String::new())))
}

/// Hours and runs of a sweep at a speed.
fn price(text: &str, speed: &Speed, slots: usize) -> Result<(f64, usize)> {
    let plan = plan(text)?;
    let jobs: Vec<Job> = all_jobs(&plan).collect();
    Ok((speed.hours(&jobs, &plan, slots), plan.runs.len()))
}

// [`largest`]: the sweep that takes the time that there is.

/// The largest budget of the smallest sweep that is offered, FLOPs.
const LEAST: f64 = 1.6e10;
/// Budgets that are tried of each doubling of it.
const STEPS: i32 = 8;
/// The last budget tried: 33 million times the first.
const LAST: i32 = 25 * STEPS;
/// Larger budgets that are looked at behind the largest found: hours do not grow with each step.
const LOOK_AHEAD: i32 = 2 * STEPS;
/// Seeds of runs and of tokenizers, in the order in which time is spent on them.
const SEEDS: [[u64; 2]; 4] = [[1, 1], [2, 1], [3, 1], [3, 3]];
/// With these the noise of runs is measured, and the rest of the time goes to larger budgets.
const MEASURED: [u64; 2] = SEEDS[1];

/// Fewer hours that are looked at, each a fifth below the last: a thousandth at least.
const FEWER: i32 = 30;

/// Share of the hours that a sweep may take by the estimate, which is not exact.
const SPENT: f64 = 0.93;

/// A sweep that fits, and what it takes.
#[derive(Debug)]
struct Offer {
    pub design: Design,
    pub hours: f64,
    pub runs: usize,
}

/// The settings and speeds for sweeps.
struct Terms<'a> {
    pub hours: f64,
    /// Codes of the training split; `None` if they have no end.
    pub unique_tokens: Option<usize>,
    /// Hours and runs.
    pub price: &'a dyn Fn(&Design) -> Result<(f64, usize)>,
}

impl Terms<'_> {
    /// The largest sweep within the time. Time goes to a second seed of each run, to larger budgets for as long as
    /// the data are new, to further seeds of runs and tokenizers, and then to budgets that repeat the data.
    ///
    /// # Errors
    /// A sweep cannot be priced.
    pub fn largest(&self) -> Result<Offer> {
        let is_fresh = |step: &i32| self.bears(&self.design(*step));
        let fresh = (0..=LAST).rev().find(is_fresh).unwrap_or(0);
        let seeds = if self.fits(0, MEASURED)? { MEASURED } else { SEEDS[0] };
        let step = self.search(0, fresh, seeds)?;
        if step < fresh {
            return self.offer(step, seeds);
        }
        let mut most = seeds;
        for more in SEEDS {
            if self.fits(fresh, more)? {
                most = more;
            }
        }
        self.offer(self.search(fresh, LAST, most)?, most)
    }

    /// The most of fewer hours whose offer does not repeat the data beyond measure, in two digits; `None`
    /// where none does.
    ///
    /// # Errors
    /// A sweep cannot be priced.
    pub fn fresh_hours(&self) -> Result<Option<f64>> {
        for step in 1..=FEWER {
            let hours = format!("{:.1e}", self.hours * 0.8f64.powi(step));
            let hours = hours.parse().expect("a number was written");
            if self.bears(&Self { hours, ..*self }.largest()?.design) {
                return Ok(Some(hours));
            }
        }
        Ok(None)
    }

    fn design(&self, step: i32) -> Design {
        Design::up_to(LEAST * 2f64.powf(f64::from(step) / f64::from(STEPS)), self.unique_tokens)
    }

    /// Whether the data bear the sweep.
    fn bears(&self, design: &Design) -> bool {
        let epochs = |unique: usize| design.most_tokens() / unique as f64;
        self.unique_tokens.map(epochs).is_none_or(|epochs| epochs <= EPOCHS)
    }

    fn fits(&self, step: i32, seeds: [u64; 2]) -> Result<bool> {
        Ok((self.price)(&self.design(step).with_seeds(seeds))?.0 <= SPENT * self.hours)
    }

    /// The largest step that fits, between two of which the first does or is the least there is.
    fn search(&self, least: i32, most: i32, seeds: [u64; 2]) -> Result<i32> {
        let (mut low, mut high) = (least, most);
        while low < high {
            let middle = (low + high + 1) / 2;
            if self.fits(middle, seeds)? {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        for step in (low + 1..=most.min(low + LOOK_AHEAD)).rev() {
            if self.fits(step, seeds)? {
                return Ok(step);
            }
        }
        Ok(low)
    }

    fn offer(&self, step: i32, seeds: [u64; 2]) -> Result<Offer> {
        let design = self.design(step).with_seeds(seeds);
        let (hours, runs) = (self.price)(&design)?;
        Ok(Offer { design, hours, runs })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two slots of a slow machine and of a fast one: small models go slower than large ones.
    fn machines() -> [(Speed, usize); 3] {
        let like = |fast: f64| Speed::new(vec![(1e4, 4e9 * fast), (1e6, 2e10 * fast)], 2e10 * fast);
        [(like(1.0), 2), (like(0.7), 2), (like(2.0), 32)]
    }

    fn offer(machine: &(Speed, usize), hours: f64, unique_tokens: Option<usize>) -> Offer {
        with_terms(machine, hours, unique_tokens, |terms| terms.largest().expect("a sweep"))
    }

    fn fresh_hours(
        machine: &(Speed, usize),
        hours: f64,
        unique_tokens: Option<usize>,
    ) -> Option<f64> {
        with_terms(machine, hours, unique_tokens, |terms| terms.fresh_hours().expect("prices"))
    }

    fn with_terms<T>(
        (speed, slots): &(Speed, usize),
        hours: f64,
        unique_tokens: Option<usize>,
        then: impl Fn(&Terms) -> T,
    ) -> T {
        let price = |design: &Design| price(&design::text("a", None, design), speed, *slots);
        then(&Terms { hours, unique_tokens, price: &price })
    }

    #[test]
    fn the_hours_that_are_asked_for_are_spent() {
        for machine in machines() {
            for hours in [0.2, 1.0, 6.0, 24.0, 100.0] {
                let spent = offer(&machine, hours, None).hours / hours;
                assert!((0.7..=1.1).contains(&spent), "{spent:.2} of {hours} h on {machine:?}");
            }
        }
    }

    #[test]
    fn small_data_bind_no_hours_and_the_offer_says_how_many_they_bear() {
        let [machine, ..] = machines();
        for hours in [1.0, 6.0, 100.0] {
            let found = offer(&machine, hours, Some(400_000));
            assert!((0.7..=1.1).contains(&(found.hours / hours)), "{found:?}");
            assert!(found.design.vocab.iter().all(|v| *v <= 20_000));
        }
        let repeated = offer(&machine, 100.0, Some(400_000));
        let fresh = fresh_hours(&machine, 100.0, Some(400_000)).expect("some");
        assert!(fresh < 50.0, "{fresh}");
        // What the hint says holds where it is followed.
        let followed = offer(&machine, fresh, Some(400_000)).design.most_tokens();
        assert!(followed / 400_000.0 <= EPOCHS, "{followed}");
        assert_eq!(fresh_hours(&machine, 100.0, Some(400)), None);
        assert_eq!((repeated.design.seeds.len(), repeated.design.tokenizer_seeds.len()), (3, 3));
    }

    #[test]
    fn models_vocabularies_and_budgets_grow_with_the_hours_and_a_second_seed_measures_noise() {
        let [machine, ..] = machines();
        let designs = [1.0, 6.0, 24.0, 100.0].map(|hours| offer(&machine, hours, None).design);
        let largest = |of: &dyn Fn(&Design) -> f64| designs.each_ref().map(of);
        let last = |values: &[usize]| *values.last().expect("some") as f64;
        let grown = [
            largest(&|design| design.budgets[4]),
            largest(&|design| last(&design.widths)),
            largest(&|design| last(&design.vocab)),
        ];
        for sizes in &grown {
            assert!(sizes.is_sorted() && sizes[0] < sizes[3], "{grown:?}");
        }
        assert!(designs.iter().all(|design| design.seeds == [0, 1]), "{designs:?}");
    }
}
