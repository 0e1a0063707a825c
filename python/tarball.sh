#!/usr/bin/env bash
# dist/isoflop-VERSION-MACHINE.tar.gz: the stripped program, completions, manual pages, licences.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo build --release --locked
program=${CARGO_TARGET_DIR:-target}/release/isoflop
version=$("$program" --version | cut -d' ' -f2)
name=isoflop-$version-$(uname -m)-$(uname -s | tr '[:upper:]' '[:lower:]')
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
mkdir -p "$place/$name/completions" dist
strip -o "$place/$name/isoflop" "$program"
for shell in bash zsh fish; do
    "$program" completions "$shell" > "$place/$name/completions/isoflop.$shell"
done
"$program" man --out "$place/$name/man"
cp README.md CHANGELOG.md LICENSE-APACHE LICENSE-MIT "$place/$name"
# The same bytes of the same files, where tar is GNU's.
same=()
if tar --version | grep -q GNU; then same=(--sort=name --owner=0 --group=0 --numeric-owner); fi
tar -C "$place" ${same[@]+"${same[@]}"} -czf "dist/$name.tar.gz" "$name"
ls -l "dist/$name.tar.gz"
