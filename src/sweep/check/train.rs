//! Impossible settings of training, model and fit.

use crate::sweep::problem::Problem;
use crate::sweep::sections::{ScheduleKind, Sweep};

/// What is wrong with `train`, `model` and `fit`.
pub fn check(sweep: &Sweep) -> Vec<Problem> {
    let Sweep { train, model, .. } = sweep;
    let (schedule, batch) = (&train.schedule, &train.batch);
    let share = |x: f64| (0.0..=1.0).contains(&x);
    let below_1 = |x: f64| (0.0..1.0).contains(&x);
    let seconds = |x: f64| (0.0..=1e9).contains(&x);
    let wsd = schedule.kind == ScheduleKind::Wsd;
    let whole = "a trainer of one's own trains each run whole: take `share` out";
    let rules = [
        (share(schedule.warmup), "train.schedule.warmup", "a share lies between 0 and 1"),
        (share(schedule.final_share), "train.schedule.final_share", "a share lies between 0 and 1"),
        (
            schedule.decay > 0.0 && schedule.decay < 1.0,
            "train.schedule.decay",
            "a share lies between 0 and 1, both left out",
        ),
        (
            !schedule.share || wsd,
            "train.schedule.share",
            "only runs of `kind: wsd` begin alike and can share a trunk",
        ),
        (!schedule.share || sweep.trainer.is_none(), "train.schedule.share", whole),
        (
            !wsd || schedule.warmup + schedule.decay <= 1.0,
            "train.schedule.warmup",
            "warm-up and decay together are more than the run",
        ),
        (train.betas.len() == 2, "train.betas", "AdamW has two betas"),
        (train.betas.iter().all(|b| below_1(*b)), "train.betas", "a beta lies in [0, 1)"),
        (train.lr.coefficient > 0.0 && train.lr.max > 0.0, "train.lr", "a rate is above 0"),
        (batch.min > 0, "train.batch.min", "at least one token a step"),
        (batch.multiple_of != Some(0), "train.batch.multiple_of", "at least one token a step"),
        (batch.max >= batch.min, "train.batch.max", "must not be below `min`"),
        (train.min_steps > 0, "train.min_steps", "at least one step"),
        (train.weight_decay >= 0.0, "train.weight_decay", "must not be negative"),
        (train.clip_norm >= 0.0, "train.clip_norm", "must not be negative; 0 for none"),
        (train.epsilon >= 0.0, "train.epsilon", "must not be negative"),
        (seconds(train.checkpoint_s), "train.checkpoint_s", "seconds, between 0 and 1e9"),
        (seconds(train.hang_s), "train.hang_s", "seconds, between 0 and 1e9; 0 for never"),
        (model.rope_base > 0.0, "model.rope_base", "must be above 0"),
        (model.ffn_multiple > 0, "model.ffn_multiple", "must be at least 1"),
        (model.motion_slots > 2, "model.motion_slots", "must be at least 3"),
        (below_1(model.corruption), "model.corruption", "a share below 1"),
        (below_1(model.text_drop), "model.text_drop", "a share below 1"),
        (!sweep.fit.minima.is_empty(), "fit.minima", "at least one kind of minimum"),
    ];
    let wrong = rules.into_iter().filter(|(good, ..)| !good);
    wrong.map(|(_, path, message)| Problem::value(path, message)).collect()
}
