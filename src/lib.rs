//! isoflop: scaling-law experiments for autoregressive motion generation.
//!
//! Data flows one way, and the modules stand in that order:
//!
//! `Sweep → RunSpec → RunRecord → IsoFlopPoint → Minimum → Law → Prediction`
//!
//! | module | what it turns into what |
//! | --- | --- |
//! | [`sweep`] | a YAML file into a checked [`sweep::Sweep`] |
//! | [`plan`] | a sweep into priced runs, and cells dropped with their reasons |
//! | [`motion`] | joints into features and back; the procedural source |
//! | [`data`] | a folder or the generator into clips with captions |
//! | [`text`] | captions into frozen embeddings |
//! | [`tokenizer`] | clips into discrete codes |
//! | [`ops`], [`model`], [`train`] | codes and text into a trained model and its loss |
//! | [`schedule`] | a plan into finished jobs, one process a run |
//! | [`moving`] | work without steps into a count of its pieces, by which a scheduler sees that it goes on |
//! | [`slurm`] | the same on a cluster: jobs into arrays of packed tasks |
//! | [`record`] | a finished run into a row of a table |
//! | [`table`] | a table of runs made elsewhere into the rows that laws are fitted to |
//! | [`laws`] | rows into minima, power laws and loss laws |
//! | [`predict`] | laws and a budget into a configuration |
//! | [`figures`], [`export`] | tables and laws into SVG, PNG and notebooks |

#[cfg(not(unix))]
compile_error!(
    "isoflop needs a Unix: it ends what hangs, and outlives what is killed, by signals and process groups"
);

pub mod data;
pub mod export;
pub mod figures;
pub mod laws;
pub mod model;
pub mod motion;
pub mod moving;
pub mod ops;
pub mod plan;
pub mod predict;
pub mod record;
pub mod schedule;
pub mod slurm;
pub mod sweep;
pub mod table;
pub mod text;
pub mod tokenizer;
pub mod train;
