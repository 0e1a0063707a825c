//! Clips, scales and unigrams of a file of codes, and damage.

use super::*;

fn tokens(clips: &[&[u32]]) -> SplitTokens {
    SplitTokens::new(clips.iter().map(|clip| (*clip, 4 * clip.len())))
}

fn store(n_vocab: usize, train: &[&[u32]]) -> Result<TokenStore, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tokens.safetensors");
    let splits = [tokens(train), tokens(&[]), tokens(&[&[2]])];
    write_store(&path, &Grid::stream(n_vocab, 4), &splits).unwrap();
    TokenStore::open(&path)
}

#[test]
fn clips_come_back_as_they_were_written() {
    let store = store(4, &[&[0, 3, 1], &[], &[2]]).unwrap();
    let clips: Vec<_> = (0..3).map(|index| store.clip(Split::Train, index)).collect();
    assert_eq!(clips, [vec![0, 3, 1], vec![], vec![2]]);
    assert_eq!(Split::ALL.map(|split| store.n_clips(split)), [3, 0, 1]);
    assert_eq!(Split::ALL.map(|split| store.n_tokens(split)), [4, 0, 1]);
    assert_eq!(store.clip(Split::Test, 0), [2]);
}

#[test]
fn unigram_probabilities_count_one_end_token_a_clip_and_sum_to_one() {
    let store = store(4, &[&[0, 0, 1], &[0]]).unwrap();
    let probs: Vec<f64> = store.unigram_log_probs(0).iter().map(|p| p.exp()).collect();
    let expected = [4.0, 2.0, 1.0, 1.0, 3.0].map(|count| count / 11.0);
    assert!(probs.iter().zip(expected).all(|(p, e)| (p - e).abs() < 1e-12), "{probs:?}");
    assert_eq!(probs.len(), 5);
}

#[test]
fn a_code_beyond_the_codebook_is_refused() {
    let error = store(3, &[&[0, 3]]).unwrap_err().to_string();
    assert!(error.contains("is damaged"), "{error}");
}

#[test]
fn a_cut_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tokens.safetensors");
    let split = tokens(&[&[1, 2, 3]]);
    write_store(&path, &Grid::stream(4, 4), &[split.clone(), split.clone(), split]).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() - 4]).unwrap();
    assert!(TokenStore::open(&path).is_err());
}

#[test]
fn scales_have_their_own_codes_and_unigrams() {
    use crate::codes::{Length, Scale};
    let scale = |n_vocab, codes| Scale { n_vocab, length: Length::Codes(codes) };
    let grid = Grid { scales: vec![scale(2, 1), scale(3, 2)], end_token: false };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tokens.safetensors");
    let train = SplitTokens::new([(&[1, 2, 0][..], 40), (&[1, 2, 2][..], 60)]);
    let none = SplitTokens::new([]);
    write_store(&path, &grid, &[train, none.clone(), none]).unwrap();
    let store = TokenStore::open(&path).unwrap();
    assert_eq!(store.scale(Split::Train, 0, 0), [1]);
    assert_eq!(store.scale(Split::Train, 1, 1), [2, 2]);
    assert_eq!((store.n_targets(Split::Train), store.n_frames(Split::Train)), (6, 100));
    assert_eq!(*store.stream(Split::Train, 0), [1, 4, 2]);
    let probs = store.stream_log_probs();
    assert_eq!(probs[..2], store.unigram_log_probs(0)[..2]);
    assert_eq!(probs[2..], store.unigram_log_probs(1));
    let of = |scale: usize| -> Vec<f64> {
        store.unigram_log_probs(scale).iter().map(|p| p.exp()).collect()
    };
    let near = |found: Vec<f64>, counts: &[f64]| {
        let total: f64 = counts.iter().sum();
        found.iter().zip(counts).all(|(p, count)| (p - count / total).abs() < 1e-12)
    };
    assert!(near(of(0), &[1.0, 3.0, 1.0]), "{:?}", of(0));
    assert!(near(of(1), &[2.0, 1.0, 4.0, 1.0]), "{:?}", of(1));
    let (seen, unseen) = (SplitTokens::new([(&[1, 0, 0][..], 40)]), [(&[1, 2, 0][..], 40)]);
    write_store(&path, &grid, &[seen.clone(), seen, SplitTokens::new(unseen)]).unwrap();
    assert_eq!(TokenStore::open(&path).unwrap().zero_count_targets(), 1);
    let wrong = SplitTokens::new([(&[1, 3, 0][..], 40)]);
    write_store(&path, &grid, &[wrong.clone(), wrong.clone(), wrong]).unwrap();
    assert!(TokenStore::open(&path).unwrap_err().is_damage());
}
