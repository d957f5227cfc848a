#!/bin/sh
# Build and trace against the number of patches, one thread, 512x512: tools/growth.sh [SHARED].
# Prints a table in Markdown.
set -e
cd "$(dirname "$0")/.."
SHARED=${1:-../shared}
cargo build --release --example peers
echo "| patches | stored build ms | stored trace ms | stored MB | placed build ms | placed trace ms | placed MB |"
echo "|---|---|---|---|---|---|---|"
for teapots in 1 8 27 125 1000 8000 29791; do
    row=$((teapots * 32))
    for kind in arr inst; do
        found=$(RAYON_NUM_THREADS=1 target/release/examples/peers "$SHARED/geometry" \
            "$kind$teapots" 512 512 "${RUNS:-3}")
        row="$row | $(echo "$found" | awk -F, '{ printf "%.1f | %.0f | %.1f", $4, $5, $7 }')"
    done
    echo "| $row |"
done
