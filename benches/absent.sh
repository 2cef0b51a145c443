#!/usr/bin/env bash
# What effects cost that are off: instructions of a render of hair under a sky, by the program and by one from which all else is
# compiled out (the feature `absent`), counted by Valgrind's callgrind. Instructions differ by some 10^-5 from run to run (threads'
# and the allocator's waits): each program runs three times.
#
#   benches/absent.sh [CARGO'S OPTIONS, as --release]
set -Eeuo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.."
work=$(mktemp -d)
trap 'rm -rf -- "$work"' EXIT
profile=debug
[[ " $* " == *" --release "* ]] && profile=release

for kind in absent whole; do
    features=()
    [[ $kind == absent ]] && features=(--features absent)
    cargo build -q "${features[@]}" "$@"
    cp -- "${CARGO_TARGET_DIR:-target}/$profile/tress" "$work/$kind"
done
for kind in whole absent; do
    for run in 1 2 3; do
        valgrind --tool=callgrind --callgrind-out-file="$work/profile" "$work/$kind" render benches/absent.toml -q \
            -o "$work/$kind.exr" --threads 1 --set output.reproducible=true 2>"$work/said"
        printf '%s, run %s: %s instructions\n' "$kind" "$run" "$(awk '/refs:/ { print $NF }' "$work/said")"
    done
done
cmp -- "$work/whole.exr" "$work/absent.exr" && echo 'the pictures are the same'
