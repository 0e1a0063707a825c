//! `--compat tao`: the three approaches of Tao et al. 2024 as their authors computed them, beside
//! what changes where their slip of a unit is mended.

use anyhow::{Context, Result, bail};
use isoflop::laws::tao::{
    Criterion, DERIVATIVE_SIZES, FrontierLaws, Interpolation, PUBLISHED_MIN_FLOPS,
    TokensPerCharacter, derivative_gamma, frontier, frontier_laws, in_millions, published_units,
};
use isoflop::laws::{Form, IsoFlopPoint, Parameters, Parametric, fit_parametric};
use isoflop::words::fit::parametric_text;
use isoflop::words::wrap;
use serde_json::{Value, json};

use super::args::FitArgs;
use super::source::Source;
use crate::commands::screen::table;

/// The published analysis, and approach 3 with the right D.
pub struct Tao {
    /// Approach 1, by Huber's function and by least squares.
    huber: FrontierLaws,
    least_squares: FrontierLaws,
    /// Approach 2.
    gamma: f64,
    /// Approach 3 in the published units; its objective is a sum, as theirs.
    published: Parametric,
    /// The same with D = H f(V), in millions of parameters and billions of tokens.
    correct: Parametric,
}

impl Tao {
    pub fn fit(source: &Source, request: &FitArgs) -> Result<Self> {
        if source.rows.parameters == Parameters::Total {
            bail!(
                "--compat tao needs N_nv and V: name params_nonvocab, n_vocab and d_model in --columns"
            );
        }
        let points = &source.rows.points;
        let front =
            frontier(points, Interpolation::Published).context("approach 1 of --compat tao")?;
        let laws = |criterion| {
            frontier_laws(&front, criterion).context("the frontier has too few points for a law")
        };
        let options = request.parametric(Form::Approach3Vocab);
        let rows = || points.iter().filter(|p| p.flops >= PUBLISHED_MIN_FLOPS);
        let published: Vec<IsoFlopPoint> = rows().map(published_units).collect();
        let correct: Vec<IsoFlopPoint> = rows().map(in_millions).collect();
        let gamma = derivative_gamma(&TokensPerCharacter::TAO, &DERIVATIVE_SIZES);
        let mut published = fit_parametric(&published, &options)?;
        published.objective = published.objective_sum;
        Ok(Self {
            huber: laws(Criterion::Huber)?,
            least_squares: laws(Criterion::LeastSquares)?,
            gamma: gamma.context("the derivative approach has no solution")?.gamma,
            published,
            correct: fit_parametric(&correct, &options)?,
        })
    }

    /// `parametric` is the published approach 3; `tao` holds the rest.
    pub fn document(&self) -> Result<Value> {
        let approach1 = |laws: &FrontierLaws| {
            json!({
                "ln_nonvocab": laws.ln_nonvocab, "exponent_nonvocab": 0.5,
                "ln_vocab": laws.ln_vocab, "exponent_vocab": laws.exponent_vocab,
                "objective_vocab": laws.objective_vocab, "n": laws.n,
            })
        };
        Ok(json!({
            "law": "approach3-vocab",
            "flops_rule": "6nd",
            "parametric": self.published,
            "tao": {
                "approach1": {
                    "huber": approach1(&self.huber),
                    "least_squares": approach1(&self.least_squares),
                },
                "gamma": self.gamma,
                "correct": self.correct,
            },
            "warnings": [self.difference()],
        }))
    }

    pub fn text(&self) -> String {
        let approach1 = |(how, laws): (&str, &FrontierLaws)| {
            let [size, vocab, exponent] =
                [laws.ln_nonvocab, laws.ln_vocab, laws.exponent_vocab].map(|x| format!("{x:.6}"));
            [how.to_string(), size, "0.5".to_string(), vocab, exponent]
        };
        let rows = [("Huber", &self.huber), ("least squares", &self.least_squares)];
        [
            wrap("", &format!("Approach 1, {} frontier points: ln N = K + s ln C.", self.huber.n)),
            table(["<", "K of N_nv", "s", "K of N_v", "s"], rows.map(approach1)),
            format!("\nApproach 2: N_v grows as N_nv^{:.5}.\n", self.gamma),
            "\nApproach 3 in the published units (N in millions, D = H/1e9 f(V/1000)).\n".into(),
            parametric_text(&self.published),
            "\nApproach 3 with the right tokens (D = H f(V), in billions).\n".into(),
            parametric_text(&self.correct),
            self.correct.warnings.iter().map(|sentence| wrap("  - ", sentence)).collect(),
            "\n".into(),
            wrap("", &self.difference()),
        ]
        .concat()
    }

    /// What the slip changes.
    fn difference(&self) -> String {
        let exponent = |law: &Parametric, term| law.coefficients.exponent(term);
        format!(
            "The published analysis evaluates f, the tokens of a character, at V in thousands, which \
             makes each D 2.6 to 3.1 times too large. With the right D the objective is {:.6} and \
             not {:.6}, and alpha2 is {:.4} and not {:.4}: on these runs the term of N_v is {}.",
            self.correct.objective_sum,
            self.published.objective_sum,
            exponent(&self.correct, 1),
            exponent(&self.published, 1),
            if self.correct.warnings.is_empty() { "identified" } else { "not identified" },
        )
    }
}
