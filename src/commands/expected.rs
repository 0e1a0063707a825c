//! [`Expected`]: where the optimum of a budget is looked for before anything is trained.

use isoflop::laws::scamo;

/// N_nv and N_v of the optimum at 1e11 FLOPs and their exponents in C, as this program's own studies of motion
/// found them (`results/procedural-law`, `results/cmu-motion`): where to look, and no more.
const NONVOCAB: (f64, f64) = (7.0e3, 0.45);
const VOCAB: (f64, f64) = (2.6e4, 0.57);
/// The largest budget that the own studies say something of, and the smallest of the published law.
const OWN_UP_TO: f64 = 1e14;
const PUBLISHED_FROM: f64 = 1e15;

/// The optimum that a law expects at a budget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    pub params_nonvocab: f64,
    pub params_vocab: f64,
    /// The law, for a person.
    pub by: &'static str,
    /// Factor within which V may be otherwise: tokenizers differ.
    pub vocab_within: f64,
}

impl Expected {
    /// By the own studies, however large the budget.
    pub fn by_own_studies(budget: f64) -> Self {
        let law = |(at, exponent): (f64, f64)| at * (budget / 1e11).powf(exponent);
        Self {
            params_nonvocab: law(NONVOCAB),
            params_vocab: law(VOCAB),
            by: "the law of small studies of motion",
            vocab_within: 2.5,
        }
    }

    /// By the law that has something to say of a budget; `None` between the two.
    pub fn of(budget: f64) -> Option<Self> {
        if budget <= OWN_UP_TO {
            return Some(Self::by_own_studies(budget));
        }
        let laws = scamo().power_laws;
        (budget >= PUBLISHED_FROM).then_some(Self {
            params_nonvocab: laws.params_nonvocab?.value_at(budget),
            params_vocab: laws.params_vocab?.value_at(budget),
            by: "the published law",
            vocab_within: 1.0,
        })
    }
}
