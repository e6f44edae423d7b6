#!/usr/bin/env bash
# Counts instructions of the fixed path, on one thread without probes, and prints a table: setup per
# splat; everything after setup per contribution; and the part of the latter that is shade's, at
# merges and at the end. The counts depend on the scene's fragments and the machine, not on the
# host's clock: the same program gives the same counts everywhere.
#
#     cargo build --release --example instructions
#     tests/programs/instructions.sh                    # the table
#     tests/programs/instructions.sh --difference       # also the changes since instructions.txt
#     tests/programs/instructions.sh > tests/programs/instructions.txt
#
# A difference is not a failure, but a change that makes something slower should state the reason.
# INSTRUCTIONS names another program.
set -euo pipefail
cd "$(dirname "$0")/../.."
program=${INSTRUCTIONS:-target/release/examples/instructions}
kept=tests/programs/instructions.txt
if [ ! -x "$program" ]; then
    echo "$program is absent: cargo build --release --example instructions" >&2
    exit 2
fi
if ! command -v valgrind >/dev/null; then
    echo "valgrind is absent: it counts" >&2
    exit 2
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# A case: its name, scene, machine, pixels per side.
count() {
    local name=$1 scene=$2 machine=$3 side=$4
    # Setup and its bins are written before fill begins; everything counted after that is fill.
    valgrind --tool=callgrind --callgrind-out-file="$folder/$name.costs" --collect-atstart=no \
        --toggle-collect='instructions::setup*' --toggle-collect='instructions::fill*' --dump-before='*fill::bins*' \
        "$program" "$scene" "$machine" plain "$side" >"$folder/$name.says" 2>"$folder/$name.log" || { cat "$folder/$name.log" >&2; return 1; }
    awk -v name="$name" '
        FNR == 1 { part = "fill"; in_shade = 0 }
        FILENAME ~ /says$/ { for (i = 1; i < NF; i++) { if ($(i + 1) ~ /^splats/) splats = $i; if ($(i + 1) ~ /^fragments/) fragments = $i }; next }
        /^desc: Trigger: --dump-before/ { part = "setup" }
        /^totals:/ { total[part] += $2 }
        # Functions have names at their first occurrence, and only numbers after that.
        /^c?fn=/ {
            text = substr($0, index($0, "=") + 1)
            number = substr(text, 1, index(text, ")"))
            if (length(text) > length(number)) called[FILENAME number] = text
            if (/^cfn=/) in_shade = called[FILENAME number] ~ /shade_for_merge|shade_side_by_side|merges::Merges<.*>::shade/
        }
        # The next line is the caller, with the inclusive cost of the call.
        /^calls=/ { getline; if (in_shade) shade += $2 }
        END {
            if (splats * fragments * total["setup"] * total["fill"] == 0) { print name ": nothing was counted" >"/dev/stderr"; exit 1 }
            printf "| %s | %.1f | %.1f | %.1f |\n", name, total["setup"] / splats, total["fill"] / fragments, shade / fragments
        }
    ' "$folder/$name.says" "$folder/$name.costs"*
}

table() {
    echo "| case | setup, a splat | all that follows, a contribution | of which shade |"
    echo "|---|---|---|---|"
    # Two at a time, printed in order.
    count reference glass-spheres reference 512 >"$folder/1" &
    count lean glass-spheres lean 512 >"$folder/2" &
    wait
    count volumes nested-shells volume 192 >"$folder/3" &
    count gaussian bouquet gaussian 96 >"$folder/4" &
    wait
    cat "$folder/1" "$folder/2" "$folder/3" "$folder/4"
}

table | tee "$folder/now"
if [ "${1:-}" = --difference ] && [ -f "$kept" ]; then
    echo "against $kept:"
    awk -F ' *[|] *' '
        NR == FNR { if ($3 + 0) was[$2] = $0; next }
        $3 + 0 {
            split(was[$2], old, / *[|] */)
            printf "  %-10s", $2
            for (i = 3; i <= 5; i++) printf "  %+.1f", $i - old[i]
            print ""
        }
    ' "$kept" "$folder/now"
fi
