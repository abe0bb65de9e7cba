#!/usr/bin/env bash
# Every target in turn for SECONDS (60) each; one line of its statistics, and the finds where there are any.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

seeds() {
    case $1 in
        scene) echo ../../workloads/scenes ;;
        energy) echo ../../power-model/tables ;;
        gpu) echo ../../sim/run/gpus ;;
        platform) echo ../../power-model/platforms ;;
        *) echo "seeds/$1" ;;
    esac
}

status=0
for target in $(cargo +nightly fuzz list --fuzz-dir .); do
    mkdir -p "corpus/$target"
    log=$(mktemp)
    if cargo +nightly fuzz run --fuzz-dir . "$target" "corpus/$target" "$(seeds "$target")" -- \
        "-max_total_time=${1:-60}" -timeout=20 -rss_limit_mb=512 -max_len=32768 > "$log" 2>&1; then
        echo "$target: $(grep -E 'DONE' "$log" | tail -1); $(tail -1 "$log")"
    else
        echo "$target: FOUND"
        tail -25 "$log"
        status=1
    fi
    rm -f "$log"
done
exit $status
