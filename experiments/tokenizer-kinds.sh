#!/usr/bin/env bash
# The kinds of experiments/tokenizer-kinds.yaml on real and on procedural motion, each for as many steps as
# took 100 seconds of one core: tokenizer-kinds.sh [ISOFLOP [SEEDS [SOURCE...]]], as in
#   experiments/tokenizer-kinds.sh target/release/isoflop "0, 1" real
# What is there already is not done again.
set -euo pipefail
isoflop=${1:-target/release/isoflop}
seeds=${2:-0}
sources=("${@:3}")
[ ${#sources[@]} -gt 0 ] || sources=(real procedural)

# NAME STEPS GENERATOR TOKENIZER, the quantizer last
kinds() {
    cat << 'KINDS'
conv-fsq          5500 autoregressive kind: convolutional, quantizer: {kind: fsq}
conv-vq           3600 autoregressive kind: convolutional, quantizer: {kind: vq}
patch-vq          3880 autoregressive kind: patch, quantizer: {kind: vq}
patch-residual    2940 scalewise      kind: patch, quantizer: {kind: residual}
patch-mini        2560 scalewise      kind: patch, quantizer: {kind: multiscale, scales: mini}
transformer-vq    4690 autoregressive kind: transformer, positions: rotary, norm: pre, quantizer: {kind: vq}
transformer-mini  1870 scalewise      kind: transformer, positions: rotary, norm: pre, quantizer: {kind: multiscale, scales: mini}
transformer-mid   1005 scalewise      kind: transformer, positions: rotary, norm: pre, quantizer: {kind: multiscale, scales: mid}
transformer-full  690  scalewise      kind: transformer, positions: rotary, norm: pre, quantizer: {kind: multiscale, scales: full}
read-by-decoder   1430 scalewise      kind: transformer, positions: rotary, norm: pre, language: {at: [detokenizer], drop: 0.1}, quantizer: {kind: multiscale, scales: mini}
read-by-both      1470 scalewise      kind: transformer, positions: rotary, norm: pre, language: {at: [tokenizer, detokenizer], drop: 0.1}, quantizer: {kind: multiscale, scales: mini}
KINDS
}

for source in "${sources[@]}"; do
    data=()
    if [ "$source" = procedural ]; then
        data=(--set 'data={source: procedural, clips: 4096}' --set 'text={}')
    fi
    while read -r name steps generator tokenizer; do
        "$isoflop" run experiments/tokenizer-kinds.yaml --jobs 1 --quiet \
            --set "name=$name" --out "results/tokenizer-kinds-$source" --set "generator=$generator" \
            --set "tokenizer={steps: $steps, seeds: [$seeds], $tokenizer}" "${data[@]}"
    done < <(kinds)
done
