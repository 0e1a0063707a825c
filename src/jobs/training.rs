//! What runs and trunks have in common: what they read, and from where they go on.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result};

use super::assignment::Assignment;
use super::folder::ResultsFolder;
use super::id::JobId;
use super::kind::JobKind;
use super::mend::{open_or_remake, train_past_damage};
use super::{text, tokens};
use crate::codes::TokenStore;
use crate::generator::{self, GeneratorError, Inputs, ScaleInputs, Training};
use crate::learn::{Branch, Checkpoints};
use crate::plan::Trunk;
use crate::spec::RunSpec;
use crate::text::TextStore;
use crate::tokenizer::Tokenizer;

/// What a run reads, opened, and where its state lies.
pub struct Opened<'a> {
    assignment: &'a Assignment<'a>,
    spec: &'a RunSpec,
    tokens: TokenStore,
    text: TextStore,
    /// The tokenizer, where the generator makes codes scale after scale.
    tokenizer: Option<Tokenizer>,
    checkpoint: PathBuf,
    every: Duration,
    /// The state of the trunk that it goes on from, and the steps done there.
    trunk: Option<(PathBuf, usize)>,
}

impl<'a> Opened<'a> {
    /// Opens what a run reads; what is damaged is made again first.
    ///
    /// # Errors
    /// It can neither be opened nor made.
    pub fn new(
        assignment: &'a Assignment<'a>,
        spec: &'a RunSpec,
        trunk: Option<(PathBuf, usize)>,
    ) -> Result<Self> {
        let tokens = JobId::new(JobKind::Tokens, &spec.tokenizer_id);
        let text = JobId::new(JobKind::Text, &spec.text_id);
        let wants_scales = generator::of(spec).wants_scales();
        let tokenizer = assignment.folder.tokenizer(&spec.tokenizer_id);
        let load = || Tokenizer::load(&tokenizer, assignment.device);
        Ok(Self {
            tokens: open_or_remake(assignment, &tokens, TokenStore::open, tokens::work)?,
            text: open_or_remake(assignment, &text, TextStore::open, text::work)?,
            tokenizer: wants_scales.then(load).transpose().context("opening its tokenizer")?,
            checkpoint: assignment.checkpoint(),
            every: assignment.checkpoint_every()?,
            assignment,
            spec,
            trunk,
        })
    }

    /// What the run reads.
    pub fn inputs(&self) -> Inputs<'_> {
        let scales = self.tokenizer.as_ref().map(|tokenizer| tokenizer as &dyn ScaleInputs);
        Inputs { tokens: &self.tokens, text: &self.text, scales }
    }

    /// Trunks shorten the way and change no result, so one that is gone is done without.
    fn checkpoints(&self) -> Checkpoints<'_> {
        let trunk = self.trunk.as_ref().filter(|(state, _)| state.exists());
        let branch = trunk.map(|(state, steps)| Branch { state, steps: *steps });
        Checkpoints { path: &self.checkpoint, every: self.every, branch }
    }

    /// Trains; where the checkpoint or the trunk turns out to be damaged, again without it.
    /// `None`: stopped.
    ///
    /// # Errors
    /// Training failed.
    pub fn train<T>(
        &self,
        mut train: impl FnMut(&Training) -> Result<T, GeneratorError>,
    ) -> Result<Option<T>> {
        let trunk = self.trunk.iter().map(|(state, _)| state.as_path());
        let states: Vec<&Path> = trunk.chain([self.checkpoint.as_path()]).collect();
        train_past_damage(&states, GeneratorError::learn_error, || {
            let (inputs, checkpoints) = (self.inputs(), self.checkpoints());
            let (spec, device) = (self.spec, self.assignment.device);
            train(&Training { spec, inputs: &inputs, device, checkpoints: &checkpoints })
        })
    }
}

/// The state of a trunk and its steps, as its spec says.
pub fn trunk_state(folder: &ResultsFolder, trunk_id: &str) -> Option<(PathBuf, usize)> {
    let job = JobId::new(JobKind::Trunk, trunk_id);
    let trunk: Trunk = folder.known_spec(&job)?;
    Some((folder.product(&job), trunk.spec.steps))
}
