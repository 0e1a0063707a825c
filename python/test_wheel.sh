#!/usr/bin/env bash
# The newest wheel of dist/ in a bare environment: the program, then the module's tests.
set -euo pipefail
cd "$(dirname "$0")/.."
wheel=$(ls -t dist/*.whl | head -1)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/venv"
"$place/venv/bin/pip" install --quiet --no-index "$wheel"
unset PYTHONPATH ISOFLOP_PROGRAM
PATH="$place/venv/bin:$PATH"
isoflop predict 1e18 --law scamo > "$place/said"
grep -q "44100 codes" "$place/said"
python -m unittest discover python/tests
