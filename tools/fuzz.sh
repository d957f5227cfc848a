#!/bin/sh
# Fuzzes all readers, from the samples and, if it is there, ../shared/corpus on. Needs a nightly
# toolchain and `cargo install cargo-fuzz`. Further arguments go to the fuzzer:
#   tools/fuzz.sh -max_total_time=1800
# What it finds lies in fuzz/artifacts; add it to samples/broken when it is mended.
set -eu
cd "$(dirname "$0")/.."
seeds=fuzz/corpus/read
mkdir -p "$seeds"
for file in samples/* samples/broken/* ../shared/corpus/*/*; do
    # The first byte of a seed is the row of FORMATS.
    case $file in
        *.x3d | *.x3dv | *.x3dj) row='\000' ;;
        *.wrl) row='\001' ;;
        *.stp | *.step | *.p21) row='\002' ;;
        *.igs | *.iges) row='\003' ;;
        *.obj) row='\004' ;;
        *) continue ;;
    esac
    [ "$(wc -c <"$file")" -le 20000 ] || continue
    { printf "$row"; cat "$file"; } >"$seeds/$(basename "$file")"
done
exec cargo +nightly fuzz run read -- -timeout=30 -rss_limit_mb=2048 -malloc_limit_mb=200 \
    -max_len=30000 "$@"
