# Recipes; `just --list` shows them.

# Everything that CI does
ci:
    bash .ci/run

# Formatting and lints
lint:
    cargo fmt --check
    cargo clippy --release --all-targets -- -D warnings

# The documentation, with warnings denied as CI has them
doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --release --no-deps --document-private-items

# Lines of code, comments and tests by room
count:
    python3 tests/count.py

# All tests
test:
    cargo test --release

# Every parser under mutated files of a fresh seed, so many seconds a kind
fuzz seconds="10":
    ISOFLOP_FUZZ_SECONDS={{seconds}} cargo test --release --test fuzz -- --nocapture no_

# The same with a number of inputs a kind; half an hour of one core
fuzz-inputs inputs="100000":
    ISOFLOP_FUZZ_INPUTS={{inputs}} cargo test --release --test fuzz -- --nocapture no_

# Sweeps on a throw-away Slurm; wants slurm-wlm and munge. `just test-slurm --ignored` adds the slow one
test-slurm *options:
    bash tests/slurm/run.sh {{options}}

# The study of a few minutes
quickstart:
    cargo run --release -- run experiments/quickstart.yaml

# The same study on real motion; wants data/cmu-motion
cmu-motion:
    cargo run --release -- run experiments/cmu-motion.yaml

# A training step and the laws, timed
bench:
    cargo bench

# Training steps beside PyTorch's; wants benches/requirements-torch.txt
bench-peer *options:
    cargo bench --bench train --no-run
    python3 benches/torch_peer.py {{options}}

# The laws, timed on one thread
bench-laws:
    POLARS_MAX_THREADS=1 cargo bench --bench laws

# The laws beside what public analyses do, timed on one core; wants benches/requirements-laws.txt
bench-laws-peer *options:
    cargo build --release
    python3 benches/laws_peer.py "${CARGO_TARGET_DIR:-target}/release/isoflop" {{options}}

# The wheel in dist/: the program and the Python module; wants maturin
wheel:
    maturin build --release --locked --out dist

# The newest wheel of dist/ in a bare environment
test-wheel:
    bash python/test_wheel.sh

# The Python module's tests with this tree's program
test-python:
    cargo build --release
    ISOFLOP_PROGRAM="${CARGO_TARGET_DIR:-target}/release/isoflop" PYTHONPATH=python python3 -m unittest discover python/tests

# The wheel, and a tarball of the stripped program with completions and manual pages, in dist/
dist: wheel
    bash python/tarball.sh

# Licences and advisories of the dependencies; wants cargo-deny
deny:
    cargo deny check
