//! Grids, codebooks and keys of quantizers of several scales.

use super::*;

fn section(change: impl FnOnce(&mut QuantizerSection), kind: QuantizerKind) -> QuantizerSection {
    let mut section = kind.section();
    change(&mut section);
    section
}

fn sizes(spec: &QuantizerSpec) -> Vec<usize> {
    spec.codebooks().iter().map(CodebookSpec::n_vocab).collect()
}

#[test]
fn a_multi_scale_vocabulary_of_512_has_the_ten_codebooks_of_lg_tok() {
    let spec = QuantizerKind::Multiscale.section().of_size(512).unwrap();
    assert_eq!(sizes(&spec), [256, 313, 370, 427, 484, 540, 597, 654, 711, 768]);
    let grid = spec.grid(4);
    assert_eq!((grid.n_codes(40), grid.n_codes(196), grid.end_token), (236, 236, false));
    assert_eq!((spec.n_vocab(), grid.n_vocab()), (5120, 5120));
}

#[test]
fn named_scales_have_the_published_sums() {
    let sums = [ScaleName::Mini, ScaleName::Mid, ScaleName::Full].map(|name| {
        assert!(scales::are_increasing(&name.lengths()));
        name.lengths().iter().sum::<usize>()
    });
    assert_eq!(sums, [104, 160, 236]);
}

#[test]
fn residual_layers_have_one_code_a_latent_each() {
    let spec = QuantizerKind::Residual.section().of_size(512).unwrap();
    let grid = spec.grid(4);
    assert_eq!((grid.n_codes(196), grid.n_vocab(), grid.end_token), (294, 3072, false));
    let fsq = section(|s| s.inner = Some(CodebookKind::Fsq), QuantizerKind::Residual);
    let spec = fsq.of_size(256).unwrap();
    assert_eq!((sizes(&spec), spec.levels()), (vec![240; 6], Some(&[8, 6, 5][..])));
    assert!(QuantizerKind::Residual.section().of_levels(&[8, 6, 5]).is_err());
}

#[test]
fn a_spec_of_several_scales_reads_back() {
    let multiscale =
        section(|s| s.scales = Some(ScaleSpec::List(vec![1, 3])), QuantizerKind::Multiscale);
    let specs = [multiscale.of_size(64), QuantizerKind::Residual.section().of_size(64)];
    for spec in specs.map(Result::unwrap) {
        let text = serde_json::to_string(&spec).unwrap();
        assert_eq!(serde_json::from_str::<QuantizerSpec>(&text).unwrap(), spec, "{text}");
        let other = text.replacen("\"kind\"", "\"knid\": 1, \"kind\"", 1);
        assert!(serde_json::from_str::<QuantizerSpec>(&other).is_err(), "{other}");
    }
}

#[test]
fn keys_of_another_kind_and_impossible_values_are_named() {
    use QuantizerKind::{Fsq, Multiscale, Residual, Vq};
    let scales = |list: &[usize]| Some(ScaleSpec::List(list.to_vec()));
    let bad = [
        (section(|s| s.layers = Some(2), Vq), "layers: belongs to `kind: residual`"),
        (section(|s| s.inner = Some(CodebookKind::Vq), Fsq), "inner: belongs to"),
        (
            section(|s| s.scales = scales(&[1, 2]), Residual),
            "scales: belongs to `kind: multiscale`",
        ),
        (section(|s| s.dropout = Some(0.1), Multiscale), "dropout: belongs to `kind: residual`"),
        (section(|s| s.layers = Some(0), Residual), "layers: must be 1 to 64"),
        (section(|s| s.dropout = Some(1.5), Residual), "dropout: lies between"),
        (section(|s| s.scales = scales(&[]), Multiscale), "scales: must be one or more"),
        (section(|s| s.scales = scales(&[3, 3]), Multiscale), "scales: must be one or more"),
        (section(|s| s.scales = scales(&[0, 3]), Multiscale), "scales: must be one or more"),
        (
            section(|s| (s.inner, s.cosine) = (Some(CodebookKind::Fsq), Some(true)), Multiscale),
            "cosine: belongs to `kind: multiscale` with `inner: vq`",
        ),
    ];
    for (section, sentence) in bad {
        let error = section.check().unwrap_err().to_string();
        assert!(error.starts_with(&format!("tokenizer.quantizer.{sentence}")), "{error}");
    }
    assert!([Fsq, Vq, Residual, Multiscale].iter().all(|kind| kind.section().check().is_ok()));
}
