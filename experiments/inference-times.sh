#!/usr/bin/env bash
# How long the papers' systems take to make a motion, at their sizes, on the device at hand:
#   experiments/inference-times.sh [ISOFLOP [OUT]]
# Each is trained for a few steps on few clips, since times do not depend on what weights say. OUT/NAME.json
# holds the times of a system; what is there already is not measured again. Takes an hour of two cores,
# which nothing else should use.
set -euo pipefail
isoflop=${1:-target/release/isoflop}
out=${2:-results/inference-times}
mkdir -p "$out"

# NAME PRESET BUDGET MODEL: a hundred small steps, and the model where the preset has several
systems() {
    cat << 'SYSTEMS'
lg-tok-mini lg-tok-mini 2.7e11
lg-tok-mid  lg-tok-mid  2.7e11
lg-tok      lg-tok      2.7e11
mosa        mosa        2.7e11
momask      momask      2.5e11
mmm         mmm         2.4e12
t2m-gpt     t2m-gpt     2.2e12
scamo-44M   scamo       5.3e11 {n_layer: 8, n_head: 8, d_model: 512}
scamo-111M  scamo       1.7e12 {n_layer: 12, n_head: 12, d_model: 768}
scamo-343M  scamo       6e12   {n_layer: 24, n_head: 16, d_model: 1024}
SYSTEMS
}

while read -r name preset budget model; do
    [ -s "$out/$name.json" ] && continue
    grid=()
    [ -z "$model" ] || grid=(--set "grid.models=[$model]" --set 'grid.vocab=[512]')
    "$isoflop" run "$preset" --quiet --out "$out" --set "name=$name" "${grid[@]}" \
        --set 'data={source: procedural, clips: 64, val_clips: 16, test_clips: 16}' \
        --set tokenizer.steps=2 --set tokenizer.pool_clips=64 --set tokenizer.batch=8 \
        --set train.batch=32 --set train.lr=1e-6 --set train.min_steps=1 \
        --set "grid.budgets=[$budget]" --set 'predict.budgets=[]'
    "$isoflop" generate --run "$out/$name" --times --json > "$out/$name.json.new"
    mv "$out/$name.json.new" "$out/$name.json"
done < <(systems)
