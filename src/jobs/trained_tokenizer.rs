//! [`TrainedTokenizer`]: a tokenizer that was trained, opened to turn motions into codes and back.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use burn::tensor::Device;

use super::assignment::frozen_sweep;
use super::folder::ResultsFolder;
use super::id::JobId;
use super::tokenizer;
use super::trained::find;
use crate::files::read_if_there;
use crate::plan::RunSpec;
use crate::text::{self, TextEncoder, as_in_data};
use crate::tokenizer::Tokenizer;

/// A trained tokenizer, with what its captions become vectors by.
pub struct TrainedTokenizer {
    /// The name of its folder.
    pub id: String,
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
        let place = folder.run(&run_id).join("spec.json");
        let spec: Option<RunSpec> = read_if_there(&place)?;
        let spec = spec.with_context(|| format!("{} is missing", place.display()))?;
        let id = JobId::new(tokenizer::KIND, &spec.tokenizer_id);
        Self::open(&folder.job(&id), device)
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
        let language = tokenizer.spec().architecture.language().is_some();
        let encoder = if language { Some(encoder_of(&place)?) } else { None };
        Ok(Self { id, tokenizer, encoder })
    }

    /// Whether it sees captions.
    pub fn has_language(&self) -> bool {
        self.encoder.is_some()
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

/// What the captions of a sweep become vectors by, from the folder of one of its tokenizers.
fn encoder_of(place: &Path) -> Result<Box<dyn TextEncoder>> {
    let root: Option<PathBuf> = place.parent().and_then(Path::parent).map(Path::to_path_buf);
    let sweep = frozen_sweep(&ResultsFolder::new(root.unwrap_or_default()));
    let sweep = sweep.context("reading how its sweep turns captions into vectors")?;
    text::encoder(&sweep.text).context("opening the vectors of captions")
}
