//! [`doubts`]: weaknesses of a sweep's minima that its plan shows before any training.

mod doubt;
pub use doubt::Doubt;

use super::data::too_few;
use super::prelude::*;
use doubt::tried;
use isoflop::plan::Plan;

/// The doubts about a plan, at most one of each kind for each generator. A sweep of one size makes no law, so its
/// grid is not judged.
pub fn doubts(sweep: &Sweep, plan: &Plan) -> Vec<Doubt> {
    let generators = tried(plan);
    let is_study = generators.iter().flatten().any(|budget| budget.sizes.len() > 1);
    let mut found: Vec<Doubt> = Vec::new();
    if is_study {
        for budgets in &generators {
            let own = [doubt::doubts(budgets), doubt::doubts_bracket(budgets)].concat();
            // Generators with the same sizes have the same doubts.
            let fresh: Vec<Doubt> = own.into_iter().filter(|own| !found.contains(own)).collect();
            found.extend(fresh);
        }
        found.extend(one_budget(plan));
        found.extend(one_seed(sweep, plan));
    }
    found.extend(small_test(plan));
    found
}

// Losses measured too roughly: on too few codes, or only once.

/// A grid of one budget has no law in C.
fn one_budget(plan: &Plan) -> Option<Doubt> {
    let first = plan.runs.first()?.spec.budget_flops;
    plan.runs.iter().all(|run| run.spec.budget_flops == first).then(|| {
        let what = "all runs have one budget, which gives a minimum but no law in C";
        of_study("one-budget", [what, "list three budgets or more"].map(String::from))
    })
}

/// With one seed, run noise is not measured.
fn one_seed(sweep: &Sweep, plan: &Plan) -> Option<Doubt> {
    if sweep.seeds.len() > 1 || sweep.tokenizer.seeds.len() > 1 {
        return None;
    }
    let what = "each cell (model, vocabulary, budget) is trained once, so run noise is estimated from the \
    residuals of a smooth surface";
    let mend = format!("set seeds: [0, 1], which doubles the {} runs", plan.runs.len());
    Some(of_study("one-seed", [what.to_string(), mend]))
}

/// The test split has too few codes, or too few groups.
fn small_test(plan: &Plan) -> Option<Doubt> {
    // Supervised codes, if its clips are as long as those of the training split; none without data.
    let [train, _, test] = plan.data.clips;
    let per_clip = plan.unique_tokens() as f64 / train as f64;
    if train == 0 || per_clip <= 0.0 {
        return None;
    }
    let words = too_few(per_clip * test as f64, test, plan.data.test_groups)?;
    Some(of_study("small-test", words))
}

fn of_study(kind: &'static str, [what, mend]: [String; 2]) -> Doubt {
    Doubt { kind, what, mend, budgets_flops: Vec::new() }
}

#[cfg(test)]
mod tests {
    use isoflop::data::{self, DataFacts};
    use isoflop::sweep;

    use super::*;

    fn of(text: &str, settings: &[&str], facts: DataFacts) -> Vec<Doubt> {
        let settings: Vec<String> = settings.iter().map(ToString::to_string).collect();
        let sweep = sweep::parse("t.yaml", text, &settings).expect("a sweep");
        doubts(&sweep, &Plan::new(&sweep, facts))
    }

    const GOOD: &str = "name: t
seeds: [0, 1]
data: {source: procedural, clips: 64}
tokenizer: {kind: patch}
grid:
  models:
    - {n_layer: 2, n_head: 1, d_model: 12}
    - {n_layer: 2, n_head: 1, d_model: 16}
    - {n_layer: 2, n_head: 1, d_model: 20}
    - {n_layer: 2, n_head: 1, d_model: 28}
  vocab: [256, 512, 1024, 2048, 4096]
  budgets: [5e10, 1e11]
";

    fn absent() -> DataFacts {
        DataFacts::absent(String::new())
    }

    /// The kinds of doubts under these settings.
    fn kinds(settings: &[&str]) -> Vec<String> {
        let found = of(GOOD, settings, absent());
        let word =
            |doubt: &Doubt| doubt.sentence().split(':').next().unwrap_or_default().to_string();
        found.iter().map(word).collect()
    }

    const ONE_SIZE: &str = "grid.models=[{n_layer: 2, n_head: 1, d_model: 16}]";

    #[test]
    fn each_doubt_is_named_before_anything_is_trained() {
        assert!(kinds(&[]).is_empty(), "{:?}", of(GOOD, &[], absent()));
        let layers = |depths: [usize; 4], widths: [usize; 4]| {
            let model = |(n, d)| format!("{{n_layer: {n}, n_head: 1, d_model: {d}}}");
            let models: Vec<String> = depths.into_iter().zip(widths).map(model).collect();
            format!("grid.models=[{}]", models.join(", "))
        };
        for (setting, kind) in [
            (layers([2; 4], [8, 12, 16, 28]), "gap"),
            (layers([2, 2, 1, 1], [8, 10, 20, 28]), "depth-change"),
            (layers([2; 4], [40, 50, 60, 70]), "not-bracketed"),
            ("grid.vocab=[32, 64, 128]".to_string(), "edge-vocab"),
            ("seeds=[0]".to_string(), "one-seed"),
        ] {
            assert_eq!(kinds(&[&setting]), [kind], "{setting}");
        }
        assert_eq!(kinds(&["seeds=[0]", "tokenizer.seeds=[0, 1]"]), [""; 0]);
        let two = "grid.exclude=['budget < 6e10 and d_model > 16']";
        assert_eq!(kinds(&[two])[0], "few-levels");
        let generators = ["seeds=[0]", "generator=[autoregressive, masked]"];
        let twice = [&generators[..], &["grid.exclude=['d_model == 16']"]].concat();
        assert_eq!(kinds(&twice), ["gap", "one-seed"], "both generators have the same gap");
        assert_eq!(kinds(&[ONE_SIZE, "seeds=[0]"]), [""; 0], "one size makes no law");
    }

    #[test]
    fn a_doubt_says_where_and_what_to_change() {
        let wide = "grid.exclude=['budget > 6e10 and d_model == 16']";
        let [gap] = &of(GOOD, &[wide], absent())[..] else { panic!("one doubt") };
        assert_eq!(gap.budgets_flops, [1e11]);
        let said = gap.sentence();
        assert!(said.contains("at 1e11 FLOPs: L2 d12 and L2 d20 (2."), "{said}");
        assert!(
            said.ends_with("add a width between them, or a minimum that falls there is flagged")
        );
        let low = &of(GOOD, &["grid.vocab=[32, 64, 128]"], absent())[0].sentence();
        assert!(
            low.contains("small studies of motion") && low.contains("at every budget"),
            "{low}"
        );
        let scamo = &of(GOOD, &["grid.models=scamo", "grid.budgets=[1e20]"], absent());
        assert!(scamo.iter().any(|doubt| doubt.what.contains("by the published law")), "{scamo:?}");
    }

    #[test]
    fn a_test_split_that_cannot_measure_a_loss_is_named_with_its_error() {
        let facts = |clips: usize| {
            let text = format!("{GOOD}# {clips}");
            let setting = [format!("data.test_clips={clips}")];
            let sweep = sweep::parse("t.yaml", &text, &setting).expect("a sweep");
            DataFacts::of(&*data::open(&sweep.data, None).expect("a source"))
        };
        let [small] = &of(GOOD, &[], facts(2))[..] else { panic!("one doubt") };
        assert_eq!(small.kind, "small-test");
        assert!(small.what.contains("codes: the mean loss is known to ±"), "{}", small.what);
        assert!(of(GOOD, &[], facts(256)).is_empty());
    }

    /// Their minima were good (`results/*/laws.json`).
    #[test]
    fn studies_that_gave_good_minima_raise_no_false_alarm() {
        for name in [
            "procedural-law",
            "motion-law",
            "motion-shares",
            "many-patches",
            "own-frames",
            "two-frames",
        ]
        .into_iter()
        .chain(["two-frames-fixed", "quickstart", "shared-trunks"])
        {
            let path = format!("{}/experiments/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
            let text = std::fs::read_to_string(path).expect("a sweep file");
            let found = of(&text, &[], absent());
            assert!(found.iter().all(|doubt| doubt.kind == "one-seed"), "{name}: {found:?}");
        }
    }
}
