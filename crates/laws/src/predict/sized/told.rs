//! The law of N and D that laws hold, and what it says of a model.

use super::types::{ModelSize, SizedOptimum};
use crate::laws::{
    Coefficients, JointLaw, Laws, Optimum, Parameters, Parametric, PerQuantity, SizedLoss, optimum,
};
use crate::predict::at_budget::width_for;
use crate::predict::{Allocation, FlopCount, PredictError, ladder_of};

/// A law of N and D.
pub(super) enum Told<'a> {
    Parametric(&'a Parametric),
    Joint(&'a JointLaw, Parameters),
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
    pub fn at(&self, laws: &Laws, model: &ModelSize) -> Result<SizedLoss, PredictError> {
        if !self.is_split() && (model.n_vocab.is_some() || model.params_vocab.is_some()) {
            return Err(PredictError::VocabularyUnknown { laws: laws.name.clone() });
        }
        match self {
            Self::Parametric(law) => self.parametric(law, laws, model),
            Self::Joint(law, _) => self.joint(law, laws, model),
        }
    }

    /// The best model for `flops`; none where the law has none.
    pub fn optimum(&self, flops: f64) -> Option<Optimum> {
        match self {
            Self::Parametric(law) => optimum(&law.coefficients, flops),
            Self::Joint(law, _) => law.optimum(flops),
        }
    }

    fn parametric(
        &self,
        law: &Parametric,
        laws: &Laws,
        model: &ModelSize,
    ) -> Result<SizedLoss, PredictError> {
        let params_vocab = match self.is_split() {
            true => of_vocabulary(laws, model)?,
            false => 0.0,
        };
        let flops = (FlopCount::SIX_ND.flops)(model.params, params_vocab, model.tokens);
        let loss = |coefficients: &Coefficients| match self.is_split() {
            true => coefficients.loss(&[model.params, params_vocab, model.tokens]),
            false => coefficients.loss(&[model.params, model.tokens]),
        };
        let replicate =
            |each: &Coefficients| Some([loss(each), optimum(each, flops).map(|best| best.loss)?]);
        Ok(SizedLoss {
            flops,
            params_vocab,
            n_vocab: model.n_vocab,
            loss: loss(&law.coefficients),
            best: self.optimum(flops),
            replicates: law.bootstrap.iter().filter_map(replicate).collect(),
        })
    }

    fn joint(
        &self,
        law: &JointLaw,
        laws: &Laws,
        model: &ModelSize,
    ) -> Result<SizedLoss, PredictError> {
        let n_vocab = if self.is_split() { Some(codes(law, laws, model)?) } else { None };
        Ok(law.sized(model.params, n_vocab, model.tokens))
    }

    /// The best model by the names of its quantities.
    pub fn named(&self, best: Optimum) -> SizedOptimum {
        let n_vocab = best.n_vocab.filter(|_| self.is_split());
        let at = PerQuantity { n_vocab, ..Allocation::from(best).named(self.parameters()) };
        SizedOptimum { at, loss_normalised: best.loss }
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
