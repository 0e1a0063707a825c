//! The law of N and D that laws hold, and what it says of a model.

use super::types::{ModelSize, SizedOptimum};
use crate::laws::{
    Coefficients, JointLaw, JointOptimum, Laws, Optimum, Parameters, Parametric, PerQuantity,
    optimum,
};
use crate::predict::at_budget::width_for;
use crate::predict::{Allocation, FlopCount, PredictError, SixNd, ladder_of};

/// A law of N and D.
pub(super) enum Told<'a> {
    Parametric(&'a Parametric),
    Joint(&'a JointLaw, Parameters),
}

/// What it says of a model.
pub(super) struct Said {
    pub flops: f64,
    /// 0 if the law knows N alone.
    pub params_vocab: f64,
    pub n_vocab: Option<f64>,
    pub loss: f64,
    pub best: Option<SizedOptimum>,
    /// The loss, and that of the best model, by each bootstrap replicate.
    pub replicates: Vec<[f64; 2]>,
}

impl<'a> Told<'a> {
    /// # Errors
    /// [`PredictError::NoLossLaw`].
    pub fn of(laws: &'a Laws) -> Result<Self, PredictError> {
        let joint = || Some(Self::Joint(laws.judgement.joint.as_ref()?, laws.parameters));
        let own = laws.parametric.as_ref().map(Self::Parametric).or_else(joint);
        own.ok_or_else(|| PredictError::NoLossLaw { laws: laws.name.clone() })
    }

    pub fn name(&self) -> &'static str {
        match self {
            Self::Parametric(law) => law.coefficients.form.name(),
            Self::Joint(law, _) => law.candidate().name(),
        }
    }

    /// Whether it tells N_nv and N_v apart.
    fn is_split(&self) -> bool {
        self.parameters() == Parameters::Split
    }

    /// What its size is.
    pub fn parameters(&self) -> Parameters {
        match self {
            Self::Parametric(law) => law.coefficients.form.parameters(),
            Self::Joint(_, parameters) => *parameters,
        }
    }

    /// What it says of `model`.
    ///
    /// # Errors
    /// [`PredictError::NoVocabulary`], or [`PredictError::VocabularyUnknown`] where one is given to a law
    /// without.
    pub fn at(&self, laws: &Laws, model: &ModelSize) -> Result<Said, PredictError> {
        if !self.is_split() && (model.n_vocab.is_some() || model.params_vocab.is_some()) {
            return Err(PredictError::VocabularyUnknown { laws: laws.name.clone() });
        }
        match self {
            Self::Parametric(law) => self.parametric(law, laws, model),
            Self::Joint(law, _) => self.joint(law, laws, model),
        }
    }

    /// The best model for `flops`.
    pub fn optimum(&self, flops: f64) -> Option<SizedOptimum> {
        match self {
            Self::Parametric(law) => {
                optimum(&law.coefficients, flops).map(|best| self.of_parametric(best))
            }
            Self::Joint(law, _) => law.optimum(flops).map(|best| self.of_joint(best)),
        }
    }

    fn parametric(
        &self,
        law: &Parametric,
        laws: &Laws,
        model: &ModelSize,
    ) -> Result<Said, PredictError> {
        let params_vocab = match self.is_split() {
            true => of_vocabulary(laws, model)?,
            false => 0.0,
        };
        let flops = SixNd.flops(model.params, params_vocab, model.tokens);
        let loss = |coefficients: &Coefficients| match self.is_split() {
            true => coefficients.loss(&[model.params, params_vocab, model.tokens]),
            false => coefficients.loss(&[model.params, model.tokens]),
        };
        let replicate =
            |each: &Coefficients| Some([loss(each), optimum(each, flops).map(|best| best.loss)?]);
        Ok(Said {
            flops,
            params_vocab,
            n_vocab: model.n_vocab,
            loss: loss(&law.coefficients),
            best: self.optimum(flops),
            replicates: law.bootstrap.iter().filter_map(replicate).collect(),
        })
    }

    fn joint(&self, law: &JointLaw, laws: &Laws, model: &ModelSize) -> Result<Said, PredictError> {
        let n_vocab = if self.is_split() { Some(codes(law, laws, model)?) } else { None };
        let sized = law.sized(model.params, n_vocab.unwrap_or(0.0), model.tokens);
        Ok(Said {
            flops: sized.flops,
            params_vocab: sized.params_vocab,
            n_vocab,
            loss: sized.loss,
            best: sized.best.map(|best| self.of_joint(best)),
            replicates: sized.replicates,
        })
    }

    fn of_parametric(&self, best: Optimum) -> SizedOptimum {
        let Optimum { params_nonvocab, params_vocab, tokens, loss } = best;
        self.best(Allocation { params_nonvocab, params_vocab, tokens }, None, loss)
    }

    fn of_joint(&self, best: JointOptimum) -> SizedOptimum {
        self.best(best.into(), self.is_split().then_some(best.n_vocab), best.loss)
    }

    fn best(&self, at: Allocation, n_vocab: Option<f64>, loss_normalised: f64) -> SizedOptimum {
        let at = PerQuantity { n_vocab, ..at.named(self.parameters()) };
        SizedOptimum { at, loss_normalised }
    }
}

/// N_v as given, or V times the width of the nearest model that can be built.
fn of_vocabulary(laws: &Laws, model: &ModelSize) -> Result<f64, PredictError> {
    let by_width = || Some(model.n_vocab? * width_for(model.params, &ladder_of(laws)).ok()?);
    let own = model.params_vocab.or_else(|| by_width().filter(|_| laws.from_sweep));
    let needs = if laws.from_sweep { "--vocab V" } else { "--params-vocab N_v" };
    own.ok_or_else(|| PredictError::NoVocabulary { laws: laws.name.clone(), needs })
}

/// V as given, or that of the N_v given, or the only one that was tried.
fn codes(law: &JointLaw, laws: &Laws, model: &ModelSize) -> Result<f64, PredictError> {
    let missing = || PredictError::NoVocabulary { laws: laws.name.clone(), needs: "--vocab V" };
    let by_params = model.params_vocab.map(|params| law.codes(model.params, params));
    model.n_vocab.or(by_params).or(laws.only_vocabulary()).ok_or_else(missing)
}
