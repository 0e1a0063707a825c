//! The captions of tokenizers with language, and motions that have a new caption for a part alone.

use super::TokenizerError;
use super::codec::Tokenizer;
use super::halves::Captions;

impl Tokenizer {
    /// The caption of one clip, if the tokenizer has language.
    pub(super) fn captions(
        &self,
        caption: Option<&[f32]>,
    ) -> Result<Option<Captions>, TokenizerError> {
        let Some(language) = self.spec().architecture.language() else { return Ok(None) };
        let (caption, wanted) = (caption.ok_or(TokenizerError::NoText)?, language.dim);
        if caption.is_empty() || !caption.len().is_multiple_of(wanted) {
            return Err(TokenizerError::TextWidth { found: caption.len(), wanted });
        }
        Ok(Some(Captions::of([caption], wanted)))
    }

    /// [`Tokenizer::encode`] of a motion whose caption is not known: a tokenizer with language sees none, as where
    /// training drops it.
    pub fn encode_uncaptioned(&self, features: &[f32]) -> Vec<u32> {
        self.encode_with(features, Some(&Captions::none(1)))
    }

    /// [`Tokenizer::decode`] of codes of [`Tokenizer::encode_uncaptioned`], without a caption too.
    ///
    /// # Errors
    /// As [`Tokenizer::decode`].
    pub fn decode_uncaptioned(
        &self,
        ids: &[u32],
        n_frames: usize,
    ) -> Result<Vec<f32>, TokenizerError> {
        self.decode_with(ids, n_frames, Some(&Captions::none(1)), 0.0)
    }

    /// [`Tokenizer::decode`] of codes of which a part was drawn for a caption, given for each latent whether it is in the
    /// part: only the frames of the part read the caption; to all others the detokenizer shows what stands for a dropped
    /// one (LG-Tok Eq. 7). With `detokenizer: context` all frames read it.
    ///
    /// # Errors
    /// As [`Tokenizer::decode`].
    pub fn decode_edited(
        &self,
        (ids, part): (&[u32], &[bool]),
        n_frames: usize,
        caption: &[f32],
        guidance: f64,
    ) -> Result<Vec<f32>, TokenizerError> {
        let captions = self.captions(Some(caption))?.map(|captions| captions.read_by(part));
        self.decode_with(ids, n_frames, captions.as_ref(), guidance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::Device;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;

    use crate::motion::N_FEATURES;
    use crate::spec::{LanguagePlace, QuantizerSpec};
    use crate::tokenizer::module::TokenizerModule;
    use crate::tokenizer::testing::{D_TEXT, Waves, transformer_spec};

    /// A transformer that sees captions at both halves.
    fn with_language() -> Tokenizer {
        let (device, mut rng) = (Device::flex(), ChaCha8Rng::seed_from_u64(3));
        let places = [LanguagePlace::Tokenizer, LanguagePlace::Detokenizer];
        let spec = transformer_spec(&places, QuantizerSpec::Fsq { levels: vec![5, 5, 5] }, 1);
        let stats = Waves::new(&[8], N_FEATURES).metadata.stats;
        let module = TokenizerModule::new(&spec, N_FEATURES, &mut rng, &device);
        Tokenizer::new(module, spec, stats, 29.97, device)
    }

    fn caption() -> Vec<f32> {
        (0..3 * D_TEXT).map(|i| (i as f32 * 0.9).sin()).collect()
    }

    #[test]
    fn a_saved_tokenizer_with_language_loads_with_the_same_codes_and_features() {
        let folder = tempfile::tempdir().unwrap();
        let tokenizer = with_language();
        tokenizer.save(folder.path()).unwrap();
        let loaded = Tokenizer::load(folder.path(), &Device::flex()).unwrap();
        let (features, caption) = (Waves::new(&[40], N_FEATURES).clip(0, 0), caption());
        let ids = tokenizer.encode(&features, Some(&caption)).unwrap();
        assert_eq!(loaded.encode(&features, Some(&caption)).unwrap(), ids);
        let decoded =
            |tokenizer: &Tokenizer| tokenizer.decode(&ids, 40, Some(&caption), 1.5).unwrap();
        assert_eq!(decoded(&loaded), decoded(&tokenizer));
    }

    #[test]
    fn a_tokenizer_with_language_wants_a_caption() {
        let (tokenizer, features) = (with_language(), Waves::new(&[8], N_FEATURES).clip(0, 0));
        let error = tokenizer.encode(&features, None).unwrap_err().to_string();
        assert!(error.contains("was given none"), "{error}");
        assert!(tokenizer.decode(&[0, 1], 8, None, 0.0).is_err());
        let error = tokenizer.encode(&features, Some(&[0.5; 7])).unwrap_err().to_string();
        assert!(error.contains("vectors of 6 numbers"), "{error}");
    }

    #[test]
    fn guidance_goes_on_from_what_is_made_without_the_caption_to_what_is_made_with_it() {
        let (tokenizer, caption, ids) = (with_language(), caption(), [3, 9, 120]);
        let guided = |g: f64| tokenizer.decode(&ids, 12, Some(&caption), g).unwrap();
        let made = |captions: &Captions| tokenizer.decode_stack(&ids, [1, 12], Some(captions), 0.0);
        let with = made(&Captions::of([&caption[..]], D_TEXT));
        let without = made(&Captions::none(1));
        assert_eq!(guided(0.0), with);
        let close = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(close(&guided(-1.0), &without) && !close(&with, &without));
        let expected: Vec<f32> =
            with.iter().zip(&without).map(|(c, u)| 3.0 * c - 2.0 * u).collect();
        assert!(close(&guided(2.0), &expected));
    }

    #[test]
    fn an_edited_motion_reads_its_caption_in_the_part_alone() {
        let (tokenizer, caption, ids) = (with_language(), caption(), [3, 9, 120]);
        let edited = |caption: &[f32], part: [bool; 3]| {
            tokenizer.decode_edited((&ids, &part), 12, caption, 0.0).unwrap()
        };
        let other: Vec<f32> = caption.iter().map(|x| -x).collect();
        let none = tokenizer.decode_uncaptioned(&ids, 12).unwrap();
        assert_eq!(edited(&caption, [false; 3]), none);
        let all = tokenizer.decode(&ids, 12, Some(&caption), 0.0).unwrap();
        assert_eq!(edited(&caption, [true; 3]), all);
        let [own, others] = [&caption, &other].map(|read| edited(read, [false, true, false]));
        assert!(own != none && own != all && own != others);
        assert!(tokenizer.decode_edited((&ids, &[true; 3]), 12, &[], 0.0).is_err());
    }

    #[test]
    fn a_motion_without_a_known_caption_is_encoded_without_one() {
        let (tokenizer, features) = (with_language(), Waves::new(&[40], N_FEATURES).clip(0, 0));
        let codes = tokenizer.encode_uncaptioned(&features);
        assert_eq!(codes, tokenizer.encode_stack(features.clone(), 1, Some(&Captions::none(1))));
        assert_ne!(codes, tokenizer.encode(&features, Some(&caption())).unwrap());
    }
}
