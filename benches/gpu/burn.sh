#!/usr/bin/env bash
# Builds one of burn's GPU devices, compares its losses with the processor's, and times it: mini beside the
# processor, with a checkpoint every 50 ms and without, and eight layers of width 512.
#
#     bash benches/gpu/burn.sh [cuda|vulkan|wgpu] [--tiny]
#
# `--tiny` leaves the large model out, for a driver in software (mesa-vulkan-drivers, with wgpu). ISOFLOP_FEATURES adds
# features to the build, e.g. burn/autotune.
set -euo pipefail
cd "$(dirname "$0")/../.."
device=${1:-cuda}
features=$device${ISOFLOP_FEATURES:+,$ISOFLOP_FEATURES}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

cargo build --release --features "$features"
isoflop=${CARGO_TARGET_DIR:-target}/release/isoflop
"$isoflop" doctor || true
cargo test --release --features "$features" --test gpu -- --nocapture --test-threads=1

# Seconds of a sweep that must end within ten minutes.
seconds() {
    local name=$1 began=$EPOCHREALTIME
    shift
    if timeout 600 "$isoflop" run "$@" --set "name=$name" --out "$out" --quiet; then
        echo "$name: $(bc <<< "$EPOCHREALTIME - $began") s"
    else
        echo "$name: not over after ten minutes, or failed"
    fi
}
seconds mini-flex tests/sweeps/mini.yaml --jobs 1
seconds "mini-$device" tests/sweeps/mini.yaml --device "$device" --jobs 1
seconds "mini-$device-one-checkpoint" tests/sweeps/mini.yaml --device "$device" --jobs 1 --set train.checkpoint_s=600

[ "${2:-}" = --tiny ] && exit
seconds "large-$device" tests/sweeps/mini.yaml --device "$device" --jobs 1 --set train.checkpoint_s=600 \
    --set 'grid.models=[{n_layer: 8, n_head: 8, d_model: 512}]' --set 'grid.vocab=[64]' --set 'grid.budgets=[6e13]' \
    --set train.batch=4096
python3 -c '
import csv, sys
for row in csv.DictReader(open(sys.argv[1])):
    print(row["tokens_per_s"], "tokens a second")
' "$out/large-$device/runs.csv"
