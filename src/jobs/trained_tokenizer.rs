//! [`TrainedTokenizer`]: a tokenizer that was trained, opened to turn motions into codes and back.

use std::path::Path;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;

use super::assignment::{frozen_sweep, spec_of};
use super::folder::ResultsFolder;
use super::id::JobId;
use super::kind::JobKind;
use super::trained::find;
use crate::codes::TokenStore;
use crate::data::{self, Split};
use crate::spec::{RunSpec, TokenizerJob};
use crate::text::{self, TextEncoder, TextStore, as_in_data};
use crate::tokenizer::{Corpus, Reconstruction, Tokenizer, reconstruct};

/// A trained tokenizer, with what its captions become vectors by.
pub struct TrainedTokenizer {
    /// The name of its folder.
    pub id: String,
    /// The folder of its sweep.
    pub folder: ResultsFolder,
    pub tokenizer: Tokenizer,
    /// Of a tokenizer with language.
    encoder: Option<Box<dyn TextEncoder>>,
}

impl TrainedTokenizer {
    /// Opens the tokenizer of a run's folder, or of a sweep's folder that of the run with the lowest L_u.
    ///
    /// # Errors
    /// There is no such run, it has not ended, or a file that is needed is missing or damaged.
    pub fn of_run(path: &Path, device: &Device) -> Result<Self> {
        let (folder, run_id) = find(path)?;
        let spec: RunSpec = spec_of(&folder, &JobId::run(&run_id))?;
        Self::open(&folder.tokenizer(&spec.tokenizer_id), device)
    }

    /// Opens a tokenizer's own folder, `…/tokenizers/<id>`.
    ///
    /// # Errors
    /// It holds no tokenizer, or a file that is needed is missing or damaged.
    pub fn open(place: &Path, device: &Device) -> Result<Self> {
        if !place.join("tokenizer.json").is_file() {
            bail!(
                "{} holds no trained tokenizer; give `tokenizers/<id>` of a sweep's folder",
                place.display()
            );
        }
        let tokenizer = Tokenizer::load(place, device)
            .with_context(|| format!("opening the tokenizer in {}", place.display()))?;
        let place = place.canonicalize().with_context(|| format!("finding {}", place.display()))?;
        let id = place.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let root = place.parent().and_then(Path::parent).map(Path::to_path_buf);
        let folder = ResultsFolder::new(root.unwrap_or_default());
        let language = tokenizer.spec().architecture.language().is_some();
        let encoder = if language { Some(encoder_of(&folder)?) } else { None };
        Ok(Self { id, folder, tokenizer, encoder })
    }

    /// Whether it sees captions.
    pub fn has_language(&self) -> bool {
        self.encoder.is_some()
    }

    /// The codes that it has made of its data.
    ///
    /// # Errors
    /// There are none, or they are damaged.
    pub fn tokens(&self) -> Result<TokenStore> {
        let path = self.folder.tokens(&self.id);
        if !path.is_file() {
            bail!("{} is not there: `isoflop run` makes the codes of the data", path.display());
        }
        Ok(TokenStore::open(&path)?)
    }

    /// How well it reconstructs a split of its data with each of these language-free guidances.
    ///
    /// # Errors
    /// The data or the vectors of their captions are missing or damaged.
    pub fn reconstruct(&self, split: Split, guidances: &[f64]) -> Result<Vec<Reconstruction>> {
        let source = data::open(&frozen_sweep(&self.folder)?.data, None)?;
        let id = JobId::new(JobKind::Tokenizer, &self.id);
        let job: TokenizerJob = spec_of(&self.folder, &id)?;
        let text = job.text_id.map(|id| TextStore::open(&self.folder.text(&id))).transpose();
        let text = text.context("opening the vectors of the data's captions")?;
        let corpus = Corpus { source: &*source, text: text.as_ref() };
        let of = |&guidance: &f64| reconstruct(&self.tokenizer, &corpus, split, guidance);
        Ok(guidances.iter().map(of).collect::<Result<_, _>>()?)
    }

    /// The vectors of a caption, which is read as the captions of data are; `None` for a tokenizer
    /// without language.
    ///
    /// # Errors
    /// A tokenizer with language is given no caption, or the encoder has no vectors of it.
    pub fn embed(&self, caption: Option<&str>) -> Result<Option<Vec<f32>>> {
        let Some(encoder) = &self.encoder else { return Ok(None) };
        let caption = caption.context("the tokenizer sees captions and the motion has none")?;
        Ok(Some(encoder.encode(&as_in_data(caption))?))
    }
}

/// What the captions of a sweep become vectors by.
fn encoder_of(folder: &ResultsFolder) -> Result<Box<dyn TextEncoder>> {
    let sweep =
        frozen_sweep(folder).context("reading how its sweep turns captions into vectors")?;
    text::encoder(&sweep.text).context("opening the vectors of captions")
}
