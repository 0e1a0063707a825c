//! Rates, defaults and impossible settings of tokenizers.

use super::*;
use crate::spec::LanguageSection;

fn with(change: impl FnOnce(&mut TokenizerSection)) -> TokenizerSection {
    let mut section = TokenizerSection::default();
    change(&mut section);
    section
}

#[test]
fn the_rate_rises_stays_and_falls_once() {
    let section = with(|s| (s.steps, s.lr, s.warmup_steps) = (Some(10), Some(1.0), Some(3)));
    let spec = section.spec(QuantizerSpec::default(), &TextSpec::default());
    let rates: Vec<f64> = (0..10).map(|step| spec.learning_rate(step)).collect();
    assert_eq!(rates, [0.25, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0, 1.0, 0.05, 0.05]);
}

#[test]
fn a_written_spec_reads_back_and_unknown_fields_are_refused() {
    let spec = TokenizerSpec { quantizer: QuantizerSpec::Vq { n_vocab: 32 }, ..Default::default() };
    let text = serde_json::to_string(&spec).unwrap();
    assert_eq!(serde_json::from_str::<TokenizerSpec>(&text).unwrap(), spec);
    let text = r#"{"training": {"widht": 8}}"#;
    let error = serde_json::from_str::<TokenizerSpec>(text).unwrap_err();
    assert!(error.to_string().contains("widht"), "{error}");
}

#[test]
fn a_bad_field_is_named() {
    assert!(TokenizerSection::default().check().is_ok());
    let section = QuantizerKind::Vq.section();
    let bad = [
        (with(|s| s.window = Some(30)), "window"),
        (with(|s| s.lr = Some(f64::NAN)), "lr"),
        (with(|s| s.lr = Some(0.0)), "lr"),
        (with(|s| s.down = Some(0)), "down"),
        (with(|s| s.beta_2 = Some(1.0)), "beta_2"),
        (with(|s| s.quantizer = Some(section)), "quantizer"),
    ];
    for (section, field) in bad {
        let error = section.check().unwrap_err().to_string();
        assert!(error.starts_with(&format!("tokenizer.{field}: ")), "{error}");
    }
    let levels = |levels: &[usize]| QuantizerSpec::Fsq { levels: levels.to_vec() };
    for quantizer in [levels(&[8, 1]), levels(&[usize::MAX, 9]), levels(&[])] {
        let spec = TokenizerSpec { quantizer, ..TokenizerSpec::default() };
        assert_eq!(spec.check().unwrap_err().field, "quantizer");
    }
}

#[test]
fn captions_are_read_by_transformers_alone_and_stay_with_their_clips() {
    let language = Some(LanguageSection::default());
    let transformer = |change: fn(&mut TokenizerSection)| {
        let language = language.clone();
        with(|s| {
            (s.kind, s.language) = (TokenizerKind::Transformer, language);
            change(s);
        })
    };
    let text = TextSpec { dim: 7, max_tokens: 9, ..TextSpec::default() };
    let spec = transformer(|_| {}).spec(QuantizerSpec::default(), &text);
    let read = spec.architecture.language().unwrap();
    assert_eq!((read.dim, read.max_tokens, read.places()), (7, 9, [true; 2]));
    let none = transformer(|s| s.language = Some(LanguageSection { at: vec![], drop: 0.1 }));
    assert_eq!(none.spec(QuantizerSpec::default(), &text).architecture.language(), None);
    let bad = [
        (with(|s| s.language = language.clone()), "tokenizer.language: belongs to"),
        (transformer(|s| s.mirror = Some(true)), "tokenizer.mirror: shows mirrored clips"),
        (transformer(|s| s.mix_arm = Some(0.1)), "tokenizer.mix_arm: shows parts of other"),
        (transformer(|s| s.layers = Some(2)), "tokenizer.layers: must be odd"),
        (transformer(|s| s.heads = Some(3)), "tokenizer.heads: 3 heads do not divide"),
        (transformer(|s| s.depth = Some(3)), "tokenizer.depth: is not of `kind: transformer`"),
    ];
    for (section, expected) in bad {
        let error = section.check().unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

#[test]
fn the_short_form_and_the_long_one_are_the_same() {
    let quantizer = Some(QuantizerKind::Vq.section());
    let long = with(|s| (s.kind, s.quantizer) = (TokenizerKind::Convolutional, quantizer));
    let short = with(|s| s.kind = TokenizerKind::Vq);
    assert_eq!(long.quantizer(), short.quantizer());
    let text = TextSpec::default();
    let spec = |section: &TokenizerSection| section.spec(QuantizerSpec::default(), &text);
    assert_eq!(spec(&long), spec(&short));
}

#[test]
fn a_window_holds_the_longest_scale_and_patches_mix() {
    let mut section = with(|s| s.kind = TokenizerKind::Patch);
    section.quantizer = Some(QuantizerKind::Multiscale.section());
    let quantizer = section.quantizer().of_size(64).unwrap();
    assert_eq!(section.spec(quantizer, &TextSpec::default()).training.window, 196);
    assert!(section.check().is_ok());
    let mix = |section: &TokenizerSection| match section.quantizer().of_size(64).unwrap() {
        QuantizerSpec::Multiscale(own) => own.mix,
        other => panic!("{other:?}"),
    };
    let mut plain = section.quantizer.clone().unwrap();
    plain.mix = Some(0.0);
    assert_eq!(mix(&section), Some(0.5));
    assert_eq!(mix(&TokenizerSection { quantizer: Some(plain), ..section.clone() }), None);
    section.window = Some(96);
    let error = section.check().unwrap_err().to_string();
    assert!(error.contains("a scale of 49 codes") && error.contains("196 or more"), "{error}");
}

#[test]
fn codes_of_a_large_vocabulary_begin_from_as_many_patches_as_those_of_a_small_one() {
    let begun = |kind, codes, codebook| {
        let section = with(|s| (s.kind, s.codes) = (kind, codes));
        let quantizer = QuantizerSpec::of_codebook(codebook);
        let spec = section.spec(quantizer, &TextSpec::default());
        spec.begun_from().map(|begun| begun.codes)
    };
    let vq = |n_vocab| CodebookSpec::Vq { n_vocab };
    let of_vq = |codes| [64, 1024, 40_000].map(|n| begun(TokenizerKind::Patch, codes, vq(n)));
    assert_eq!(of_vq(None), [1 << 15, 48 * 1024, 48 * 40_000].map(Some));
    assert_eq!(of_vq(Some(Codes::Fixed)), [48 * 64, 48 * 1024, 48 * 40_000].map(Some));
    // FSQ places no codes, and a convolutional one begins from no data.
    let fsq = CodebookSpec::Fsq { levels: vec![8, 8, 8, 8] };
    assert_eq!(begun(TokenizerKind::Patch, None, fsq), Some(1 << 15));
    assert_eq!(begun(TokenizerKind::Vq, None, vq(1024)), None);
}

#[test]
fn what_learns_codes_is_no_key_of_fixed_ones() {
    let fixed = |change: fn(&mut TokenizerSection)| {
        let mut section = with(|s| (s.kind, s.codes) = (TokenizerKind::Patch, Some(Codes::Fixed)));
        change(&mut section);
        section.check().map_err(|error| error.to_string())
    };
    assert_eq!(fixed(|_| ()), Ok(()));
    let changes: [fn(&mut TokenizerSection); 3] = [
        |s| s.encoder_blocks = Some(1),
        |s| s.commitment = Some(1.0),
        |s| s.reset_share = Some(0.1),
    ];
    for change in changes {
        assert!(fixed(change).unwrap_err().contains("belongs to `codes: learned`"));
    }
    assert!(fixed(|s| s.kind = TokenizerKind::Vq).unwrap_err().contains("`kind: patch`"));
}
