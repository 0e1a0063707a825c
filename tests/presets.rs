//! Every preset is a whole sweep, and has the published numbers that it shares with its source.

use isoflop::data::DataFacts;
use isoflop::plan::Plan;
use isoflop::spec::{CodebookSpec, QuantizerSpec, SamplingSpec};
use isoflop::sweep::{self, Sweep, presets};

fn read(name: &str) -> Result<Sweep, sweep::SweepErrors> {
    sweep::read(name.as_ref(), &[])
}

fn planned(name: &str) -> (Sweep, Plan) {
    let sweep = read(name).unwrap_or_else(|errors| panic!("{errors}"));
    let plan = Plan::new(&sweep, DataFacts::absent(String::new()));
    (sweep, plan)
}

/// The only quantizer of a preset.
fn quantizer(plan: &Plan) -> &QuantizerSpec {
    &plan.tokenizers[0].spec.quantizer
}

#[test]
fn every_preset_is_a_whole_sweep_under_its_own_name() {
    // `own-data` is of data that are not here: its cells are known when they are.
    for name in presets::NAMES.into_iter().filter(|name| *name != "own-data") {
        let (sweep, plan) = planned(name);
        assert_eq!(sweep.name, name);
        assert!(plan.dropped.is_empty() || name.starts_with("scamo"), "{name}: {:?}", plan.dropped);
        assert!(!plan.runs.is_empty(), "{name}");
        assert!(plan.warnings().len() <= 1 || name.starts_with("scamo"), "{:?}", plan.warnings());
    }
}

#[test]
fn every_preset_says_where_it_comes_from_and_what_differs() {
    for name in presets::NAMES {
        let text = presets::find(name).expect("it is one of the names").text;
        assert!(text.starts_with("# "), "{name} begins with its source");
        let is_derived = text.contains("\npreset: ");
        let says = ["Not as", "Rates follow", "as `"].iter().any(|words| text.contains(words));
        assert!(says || is_derived, "{name} says what differs");
    }
}

/// LG-Tok's three sets of scales and its ten codebooks.
#[test]
fn lg_tok_has_its_published_codes() {
    let sizes = [256, 313, 370, 427, 484, 540, 597, 654, 711, 768];
    for (name, codes) in [("lg-tok", 236), ("lg-tok-mid", 160), ("lg-tok-mini", 104), ("mosa", 236)]
    {
        let (_, plan) = planned(name);
        let spec = &plan.tokenizers[0].spec;
        assert_eq!(spec.grid().n_codes(196), codes, "{name}");
        // As many latents as the longest scale has codes, of a clip of any length; MoSa's follow the length.
        let latents = [24, 196].map(|n_frames| spec.architecture.n_latents(n_frames));
        let longest = spec.quantizer.longest_scale();
        let shortest = if name == "mosa" { 6 } else { longest };
        assert_eq!(latents, [shortest, longest], "{name}");
        let QuantizerSpec::Multiscale(quantizer) = quantizer(&plan) else { panic!("{name}") };
        let found: Vec<usize> = quantizer.codebooks.iter().map(CodebookSpec::n_vocab).collect();
        assert_eq!(found, sizes, "{name}");
        assert_eq!((quantizer.mix, quantizer.beta), (None, 1.0), "two convolutions with ReLU");
        assert_eq!(quantizer.cosine, name != "mosa");
    }
}

/// The likeliest tenth of 512 codes is 52, and MoMask's scale of 4 a guidance of 3; a preset's ids do not depend on its sampling.
#[test]
fn motions_of_presets_are_sampled_as_their_authors_do() {
    let of = |name| read(name).unwrap_or_else(|errors| panic!("{errors}")).sampling;
    let lg_tok = of("lg-tok");
    assert_eq!([lg_tok.guidance, lg_tok.detokenizer_guidance], [4.0, 2.0]);
    assert_eq!((lg_tok.top_p, lg_tok.top_k), (Some(0.95), None));
    assert_eq!([of("lg-tok-mid"), of("lg-tok-mini")], [lg_tok.clone(), lg_tok]);
    for name in ["momask", "momask-lg"] {
        let own = of(name);
        assert_eq!((own.guidance, own.top_k, own.top_p, own.rounds), (3.0, Some(52), None, 18));
    }
    assert_eq!(of("scamo"), SamplingSpec::default());
    let plain = sweep::read("momask".as_ref(), &["sampling={rounds: 3}".into()]);
    let plain = plain.unwrap_or_else(|errors| panic!("{errors}"));
    let id =
        |sweep: &Sweep| Plan::new(sweep, DataFacts::absent(String::new())).runs[0].run_id.clone();
    assert_eq!(id(&plain), id(&planned("momask").0));
}

/// The budget buys the passes over the data that the paper made: 500 epochs of 23384 clips.
#[test]
fn budgets_are_the_training_that_their_comments_name() {
    let clips = 500.0 * 23384.0;
    let targets = [
        ("lg-tok", clips * 236.0),
        ("lg-tok-mid", clips * 160.0),
        ("lg-tok-mini", clips * 104.0),
        ("mosa", clips * 236.0),
        ("t2m-gpt", 300e3 * 128.0 * 36.0),
        ("mmm", 75e3 * 512.0 * 35.0),
    ];
    for (name, tokens) in targets {
        let (_, plan) = planned(name);
        let found = plan.runs[0].spec.tokens() as f64;
        assert!((found / tokens - 1.0).abs() < 0.01, "{name}: {found:e} for {tokens:e}");
    }
}

#[test]
fn single_codebooks_have_their_published_sizes() {
    for (name, codes) in [("t2m-gpt", 512), ("mmm", 8192)] {
        let (_, plan) = planned(name);
        assert_eq!(quantizer(&plan), &QuantizerSpec::Vq { n_vocab: codes });
        assert_eq!(plan.tokenizers[0].spec.grid().n_codes(196), 49);
    }
}

/// The arithmetic of ScaMo's released code: blocks and the final norm.
#[test]
fn scamo_has_its_six_sizes_and_seven_vocabularies() {
    let (_, plan) = planned("scamo");
    let mut sizes: Vec<usize> = plan.runs.iter().map(|run| run.params.nonvocab).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let expected = [27_271_680, 84_953_856, 308_331_520, 731_475_200, 1_359_103_488, 2_988_598_400];
    assert_eq!(sizes, expected);
    let mut vocabularies: Vec<usize> =
        plan.tokenizers.iter().map(|job| job.spec.n_vocab()).collect();
    vocabularies.sort_unstable();
    assert_eq!(vocabularies, [240, 512, 1000, 1920, 4375, 15360, 64000]);
}

/// Kept apart from the presets of the papers: a size that trains in minutes.
#[test]
fn small_presets_are_small() {
    for name in presets::NAMES.into_iter().filter(|name| name.ends_with("-nano")) {
        let (_, plan) = planned(name);
        // Some two minutes of a core.
        assert!(plan.total_flops() < 2e13, "{name}: {:e}", plan.total_flops());
        assert!(plan.runs.iter().all(|run| run.params.nonvocab < 1_000_000), "{name}");
    }
}
