# Recipes; `just --list` shows them.

# Everything that CI does
ci:
    bash .ci/run

# Formatting and lints
lint:
    cargo fmt --check
    cargo clippy --release --all-targets -- -D warnings

# All tests
test:
    cargo test --release

# The study of a few minutes
quickstart:
    cargo run --release -- run experiments/quickstart.yaml

# The same study on real motion; wants data/cmu-motion
cmu-motion:
    cargo run --release -- run experiments/cmu-motion.yaml

# A training step and the laws, timed
bench:
    cargo bench

# Licences and advisories of the dependencies; wants cargo-deny
deny:
    cargo deny check
