//! The real program, each test in a directory of its own.

mod bits;
mod compare;
mod custom_trainer;
mod data;
mod edit;
mod exact;
mod export;
mod failures;
mod faults;
mod folder;
mod generate;
mod humanml3d;
mod interruptions;
mod laws;
mod mistakes;
mod older;
mod output;
mod plan;
mod presets;
mod report;
mod rounds;
mod scored;
mod shares;
mod slurm;
mod status;
#[path = "../support/mod.rs"]
mod support;
mod tables;
mod text_file;
mod tokenize;
mod tokenizer;
#[path = "../support/torch.rs"]
mod torch;
mod torch_tokenizer;
mod torch_trainer;
mod track;
mod trunks;
mod tune;
mod validate;
mod vary;
mod victim;
mod words;
