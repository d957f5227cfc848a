#!/bin/sh
# Times this program beside Embree on the same teapots and the same camera, one thread, and
# prints the ratios: tools/peers.sh [SHARED]. Needs g++ and libembree-dev.
set -e
cd "$(dirname "$0")/.."
SHARED=${1:-../shared}
CORE=${CORE:-0}
RUNS=${RUNS:-7}
WORK=target/peers
mkdir -p "$WORK"
[ -x "$WORK/bench" ] || g++ -O3 -march=native -o "$WORK/bench" "$SHARED/peers/embree/bench.cpp" -lembree3
python3 "$SHARED/peers/teapot.py" bin "$WORK/teapot.bin"
python3 "$SHARED/peers/teapot.py" cam > "$WORK/cam.txt"
cargo build --release --example peers
echo "scene,width,height,embree_ms,ours_ms,ratio,ours_build_ms,ours_trace_ms,ours_MB"
# Scene, size, and the rival's fastest primitive at the N where its error is below 0.1 pixel
# (0.5 for the arrays; ours has none).
while read -r scene width height n mode; do
    embree=$(taskset -c "$CORE" "$WORK/bench" "$WORK/teapot.bin" "$WORK/cam.txt" \
        "$scene" "$width" "$height" "$n" "$mode" "$RUNS" 2>/dev/null |
        awk -F, '{ best = $10; for (k = 11; k <= 12; k++) if ($k < best) best = $k
            print $7 + $8 + best }')
    ours=$(RAYON_NUM_THREADS=1 taskset -c "$CORE" target/release/examples/peers \
        "$SHARED/geometry" "$scene" "$width" "$height" "$RUNS")
    echo "$ours" | awk -F, -v embree="$embree" \
        '{ printf "%s,%s,%s,%.2f,%s,%.2f,%s,%s,%s\n", $1, $2, $3, embree, $6, $6 / embree, $4, $5, $7 }'
done <<LIST
teapot 512 512 37 grid
teapot 1920 1080 53 grid
arr1000 512 512 7 grid
arr1000 1920 1080 11 grid
inst1000 512 512 8 tri
LIST
