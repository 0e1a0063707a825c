//! `isoflop predict --params N --tokens D`: the loss of a model that need not be the optimum.

use anyhow::Result;
use clap::Args;
use isoflop::laws::Laws;
use isoflop::predict::{ModelSize, predict_sized};
use isoflop::table::number;
use isoflop::words::prediction::sized_text;
use serde_json::json;

use crate::commands::exit::Exit;
use crate::commands::output::Output;

#[derive(Args)]
#[command(next_help_heading = "Loss of a given model")]
pub struct SizedArgs {
    /// N of a model whose loss is asked for, in place of an optimum; N_nv if the law tells N_v apart
    #[arg(long, value_name = "N", value_parser = amount, requires = "tokens")]
    params: Option<f64>,
    /// D, the tokens that it is trained on
    #[arg(long, value_name = "D", value_parser = amount, requires = "params")]
    tokens: Option<f64>,
    /// V, for the laws of a sweep of several vocabularies
    #[arg(long, value_name = "V", value_parser = amount, requires = "params")]
    vocab: Option<f64>,
    /// N_v in place of V
    #[arg(long, value_name = "N_v", value_parser = amount, requires = "params", conflicts_with = "vocab")]
    params_vocab: Option<f64>,
}

impl SizedArgs {
    /// The model, if one is asked for.
    pub fn model(&self) -> Option<ModelSize> {
        Some(ModelSize {
            params: self.params?,
            n_vocab: self.vocab,
            params_vocab: self.params_vocab,
            tokens: self.tokens?,
        })
    }
}

/// A count of parameters or tokens.
fn amount(text: &str) -> Result<f64, String> {
    match number(&text.replace('_', "")) {
        Some(amount) if amount > 0.0 && amount.is_finite() => Ok(amount),
        _ => Err(format!("{text} is not a number above 0, as 7e9 or 7B")),
    }
}

pub fn predict(laws: &Laws, model: &ModelSize, output: &Output) -> Result<Exit> {
    let said = predict_sized(laws, model)?;
    output.result(&json!([said]), &sized_text(&said))
}
