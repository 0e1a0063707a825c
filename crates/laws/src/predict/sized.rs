//! Predicts the loss of a model that need not be the best one for its FLOPs.

use serde::{Deserialize, Serialize};

use super::{Allocation, FlopCount, PredictError, ladder_of};
use crate::laws::text::count;
use crate::laws::{
    Coefficients, JointLaw, Laws, Optimum, Parameters, Parametric, PerQuantity, SizedLoss,
    interval95, optimum,
};
use crate::predict::allocation::width_for;
use crate::predict::optimum::{below_fit, loss_name};
use crate::predict::warnings::is_far;

/// A model, and the tokens that it is trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelSize {
    /// N, or N_nv for laws with a vocabulary.
    pub params: f64,
    /// V, for laws with a vocabulary.
    pub n_vocab: Option<f64>,
    /// N_v in place of V.
    pub params_vocab: Option<f64>,
    /// D.
    pub tokens: f64,
}

/// The loss of a model on some tokens, and of the best model for the same FLOPs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizedPrediction {
    /// Name of the laws.
    pub law: String,
    /// The law of N and D that was asked: `approach3`, `approach3-vocab`, `joint` or `joint-repeats`.
    pub form: String,
    /// The column or expression of a table that gives the loss; absent for L_u.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub loss_name: Option<String>,
    /// V is known if it was given or only one was tried.
    #[serde(flatten)]
    pub model: PerQuantity<f64>,
    /// C that the model spends on its tokens, as the law counts.
    pub flops: f64,
    pub loss_normalised: f64,
    /// The best model for `flops`, by the same law.
    pub optimum: SizedOptimum,
    /// `loss_normalised` less the optimum's.
    pub loss_above_optimum: f64,
    /// FLOPs with which the best model reaches `loss_normalised`.
    pub flops_of_equal_loss: Option<f64>,
    pub ci95: SizedIntervals,
    /// `flops` over the largest fitted budget.
    pub extrapolation_factor: f64,
    /// The smallest fitted budget over `flops`, where these lie below the fit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below_fit: Option<f64>,
    /// Sentences for a person.
    pub warnings: Vec<String>,
}

/// The best model for a budget, under the names that [`SizedPrediction`] has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizedOptimum {
    #[serde(flatten)]
    pub at: PerQuantity<f64>,
    pub loss_normalised: f64,
}

/// 95 % bootstrap percentile intervals; absent if the law holds no bootstrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SizedIntervals {
    pub loss_normalised: Option<[f64; 2]>,
    pub optimum_loss: Option<[f64; 2]>,
    /// Interval of the difference, replicate by replicate.
    pub loss_above_optimum: Option<[f64; 2]>,
}

/// Bisections for the FLOPs of an equal loss: ln C to 1e-10.
const STEPS: usize = 40;
/// Largest factor fewer FLOPs at which an equal loss is searched.
const LN_FEWEST: f64 = 30.0;

/// Predicts the loss of `model` by the law of N and D in `laws`, and the best model for its FLOPs.
///
/// # Errors
/// [`PredictError::NoLossLaw`] if the laws cover only optimal models,
/// [`PredictError::NoVocabulary`] if they need V and it is not given, [`PredictError::OutOfRange`].
pub fn predict_sized(laws: &Laws, model: &ModelSize) -> Result<SizedPrediction, PredictError> {
    let law = Told::of(laws)?;
    let said = law.at(laws, model)?;
    let out_of_range = || PredictError::OutOfRange { laws: laws.name.clone(), budget: said.flops };
    let best = said.best.filter(|_| said.loss.is_finite()).ok_or_else(out_of_range)?;
    let each = |of: fn(&[f64; 2]) -> f64| interval95(said.replicates.iter().map(of));
    let mut prediction = SizedPrediction {
        law: laws.name.clone(),
        form: law.name().to_string(),
        loss_name: loss_name(laws),
        model: PerQuantity {
            params_nonvocab: Some(model.params),
            params_vocab: Some(said.params_vocab),
            n_vocab: said.n_vocab,
            tokens: Some(model.tokens),
            ..PerQuantity::default()
        }
        .under(law.parameters()),
        flops: said.flops,
        loss_normalised: said.loss,
        optimum: law.named(best),
        loss_above_optimum: said.loss - best.loss,
        flops_of_equal_loss: equal_loss(&law, said.loss, said.flops),
        ci95: SizedIntervals {
            loss_normalised: each(|[loss, _]| *loss),
            optimum_loss: each(|[_, best]| *best),
            loss_above_optimum: each(|[loss, best]| loss - best),
        },
        extrapolation_factor: said.flops / laws.range()[1],
        below_fit: below_fit(laws, said.flops),
        warnings: Vec::new(),
    };
    prediction.warnings = cautions(&prediction, laws, &law);
    Ok(prediction)
}

/// The FLOPs with which the best model reaches `loss`, at most `flops`; `None` if that is out of reach.
fn equal_loss(law: &Told, loss: f64, flops: f64) -> Option<f64> {
    let (mut low, mut high) = (flops.ln() - LN_FEWEST, flops.ln());
    let above = |ln_flops: f64| Some(law.optimum(ln_flops.exp())?.loss - loss);
    above(low).filter(|above| *above > 0.0)?;
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        if above(middle)? > 0.0 { low = middle } else { high = middle }
    }
    Some((0.5 * (low + high)).exp())
}

// The law of N and D, evaluated at a model.

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

    /// The kind of its size.
    pub fn parameters(&self) -> Parameters {
        match self {
            Self::Parametric(law) => law.coefficients.form.parameters(),
            Self::Joint(_, parameters) => *parameters,
        }
    }

    /// Evaluates it at `model`.
    ///
    /// # Errors
    /// [`PredictError::NoVocabulary`], or [`PredictError::VocabularyUnknown`] if one is given to a law without.
    fn at(&self, laws: &Laws, model: &ModelSize) -> Result<SizedLoss, PredictError> {
        let split = self.parameters() == Parameters::Split;
        if !split && (model.n_vocab.is_some() || model.params_vocab.is_some()) {
            return Err(PredictError::VocabularyUnknown { laws: laws.name.clone() });
        }
        let law = match self {
            Self::Parametric(law) => law,
            Self::Joint(law, _) => {
                let n_vocab = if split { Some(codes(law, laws, model)?) } else { None };
                return Ok(law.sized(model.params, n_vocab, model.tokens));
            }
        };
        let params_vocab = if split { of_vocabulary(laws, model)? } else { 0.0 };
        let flops = (FlopCount::SIX_ND.flops)(model.params, params_vocab, model.tokens);
        let loss = |coefficients: &Coefficients| match split {
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

    /// The best model for `flops`; `None` if the law has none.
    pub fn optimum(&self, flops: f64) -> Option<Optimum> {
        match self {
            Self::Parametric(law) => optimum(&law.coefficients, flops),
            Self::Joint(law, _) => law.optimum(flops),
        }
    }

    /// The best model by the names of its quantities.
    pub fn named(&self, best: Optimum) -> SizedOptimum {
        let n_vocab = best.n_vocab.filter(|_| self.parameters() == Parameters::Split);
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

/// V as given, or from the given N_v, or the only one tried.
fn codes(law: &JointLaw, laws: &Laws, model: &ModelSize) -> Result<f64, PredictError> {
    let missing = || PredictError::NoVocabulary { laws: laws.name.clone(), needs: "--vocab V" };
    let by_params = model.params_vocab.map(|params| law.codes(model.params, params));
    model.n_vocab.or(by_params).or(laws.only_vocabulary()).ok_or_else(missing)
}

// Warnings about the loss of a model.

/// Runs that count less than this share are hardly fitted.
const HARDLY: f64 = 0.5;
/// Vocabularies no further apart in logarithms are one.
const SAME: f64 = 1e-6;

fn cautions(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Vec<String> {
    let sentences = [
        other_law(prediction, laws, law),
        size(prediction, laws),
        vocabulary(prediction, laws),
        off_the_minimum(prediction, laws, law),
        rule(laws, law),
        noise_alone(prediction, law),
    ];
    sentences.into_iter().flatten().collect()
}

/// A size far outside the range tried.
fn size(prediction: &SizedPrediction, laws: &Laws) -> Option<String> {
    let [low, high] = laws.judgement.tried?.sizes;
    let size = *prediction.model.size()?;
    is_far(size, [low, high]).then(|| {
        format!(
            "{} = {} lies far outside the sizes tried ({} to {}).",
            laws.parameters.size(),
            count(size),
            count(low),
            count(high)
        )
    })
}

/// Another vocabulary than the only one tried.
fn vocabulary(prediction: &SizedPrediction, laws: &Laws) -> Option<String> {
    let (asked, only) = (prediction.model.n_vocab?, laws.only_vocabulary()?);
    ((asked / only).ln().abs() > SAME).then(|| {
        format!("The runs tried V = {only:.0} alone: the law knows nothing of V = {asked:.0}.")
    })
}

/// A model so far from the best one that the joint law was hardly fitted to such runs.
fn off_the_minimum(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Option<String> {
    let (Told::Joint(..), Some(noise)) = (law, laws.noise) else { return None };
    let counts = JointLaw::counts(prediction.loss_above_optimum, noise.sd);
    (counts < HARDLY).then(|| {
        format!(
            "The joint law is fitted to runs near each budget's minimum: one as far above it as this \
             model counts {counts:.2} of the best run. `isoflop fit --law approach3` counts all runs \
             alike; compare the two."
        )
    })
}

/// Another law than the joint one is recommended, and says another loss of the best model.
fn other_law(prediction: &SizedPrediction, laws: &Laws, law: &Told) -> Option<String> {
    let Told::Joint(..) = law else { return None };
    let own = laws.recommended_law();
    let loss = laws.loss_of_minima(own, prediction.flops)?;
    Some(format!(
        "The recommended law is {}, which knows best models alone: their loss at these FLOPs is {loss:.4} by it, and \
         {:.4} by the joint law.",
        own.about(),
        prediction.optimum.loss_normalised
    ))
}

/// The parametric laws count 6ND, whatever the table's budgets count.
fn rule(laws: &Laws, law: &Told) -> Option<String> {
    (matches!(law, Told::Parametric(_)) && laws.flops_rule != "6nd")
        .then(|| format!("FLOPs are counted as 6ND here, and in the fit by {}.", laws.flops_rule))
}

/// Beyond the fit, a joint law's own interval ignores the errors of its forecasts.
fn noise_alone(prediction: &SizedPrediction, law: &Told) -> Option<String> {
    if prediction.ci95.loss_normalised.is_none() {
        return Some(format!("{} holds no bootstrap, so there are no intervals.", prediction.law));
    }
    (matches!(law, Told::Joint(..)) && prediction.extrapolation_factor > 1.0).then(|| {
        "These intervals hold the scatter of the runs alone; those of `isoflop predict C` also hold \
         how far the law's forecasts missed."
            .to_string()
    })
}
