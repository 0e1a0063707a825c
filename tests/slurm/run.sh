#!/usr/bin/env bash
# Brings a throw-away Slurm of two nodes up, runs tests/slurm on it, and takes it down.
#   tests/slurm/run.sh [--ignored] [NAME OF A TEST]
set -euo pipefail
cd "$(dirname "$0")/../.."
PATH=$PATH:/usr/sbin:/sbin
for program in sbatch slurmctld slurmd munged; do
    command -v "$program" > /dev/null || {
        echo "$program is missing: apt-get install --no-install-recommends slurm-wlm munge" >&2
        exit 1
    }
done

# A short path: munge listens on a socket in it, and the names of sockets are short.
SLURM_DEV_DIR=$(mktemp -d /tmp/isoflop-slurm-XXXX)
port=$((20000 + RANDOM % 20000))
export SLURM_DEV_DIR SLURM_DEV_CTLD_PORT=$port SLURM_DEV_NODE_PORT=$((port + 1))
export SLURM_DEV_SLURMD_TIMEOUT=5 SLURM_DEV_CRED_EXPIRE=5 SLURM_DEV_MAX_ARRAY=5
export SLURM_DEV_MIN_JOB_AGE=5
trap 'tests/slurm/slurm-down.sh' EXIT
eval "$(tests/slurm/slurm-up.sh)"
cargo test --release --test slurm -- --test-threads=1 "$@"
