#!/bin/sh
# Compares the standard cells of the units with the cost model: maps the SystemVerilog of each unit
# (rtl_model/rtl), optimised for area, to the open 180 nm cells of Debian's package
# qflow-tech-osu018. There a NAND2X1 has 24 units of area and a flip-flop, DFFPOSX1, 96. Needs Yosys
# (Debian: yosys).
#
#   gates.sh [--splatsim BINARY] [--set PATH=VALUE]... [--units UNIT,...] [--seconds N]
#            [MACHINE...]
#
# For each machine (tiny, lean, reference) and unit it prints:
#   gates  gate equivalents, as `splatsim machine cost` gives them
#   logic  area of all cells except flip-flops, in NAND2
#   model  gates without flip-flops
#   ratio  logic over model
#   FFs    flip-flops of the state of the RTL implementation; the model also counts those of its
#          stages (pipes are wires here)
# The last lines are the geometric mean of logic over model, and its range.
#
# Only a unit's own logic is synthesised, as in area.sh. The 2 by 2 pixels of the fragment unit stay
# a memory and are not counted. A multiplexer that holds a word of the state is logic. A synthesis
# that takes longer than --seconds (180) is left out: `-`.
set -euf
here=$(cd "$(dirname "$0")" && pwd)
rtl=$here/../../rtl_model/rtl
splatsim=$here/../../target/release/splatsim
cells=/usr/share/qflow/tech/osu018/osu018_stdcells.lib
units=project,ellipse,raster,gauss,fragment,shade,resolve
sets="--set timing.raster.lanes=[1,1]"
seconds=180
while [ $# -gt 0 ]; do
    case $1 in
        --splatsim) splatsim=$(realpath "$2"); shift 2 ;;
        --set) sets="$sets --set $2"; shift 2 ;;
        --units) units=$2; shift 2 ;;
        --seconds) seconds=$2; shift 2 ;;
        -*) echo "gates.sh: what is $1?" >&2; exit 2 ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || set -- tiny lean reference
[ -f $cells ] || { echo "gates.sh: $cells is missing: apt-get install qflow-tech-osu018" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
. "$here/logic.sh"

# machine, unit: NAND2 of logic, flip-flops; - if it takes too long
synthesise() {
    parameters= tables=memory_map
    case $2 in
        # Its memory is one module; it has no tables.
        fragment) parameters="-chparam WIDTH 2 -chparam HEIGHT 2" tables= ;;
        raster) parameters="-chparam TAG_W 1 -chparam SIDE 16" ;;
    esac
    # The ROMs are read relative to the trace's folder.
    (cd "$work/$1" && timeout "$seconds" yosys -q -p "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer $sources
        hierarchy -top $2 $parameters; synth -flatten -run begin:fine; opt -fast -full; $tables; opt -undriven -fine; techmap; opt -fast
        dfflibmap -liberty $cells; abc -liberty $cells -script $here/smallest.abc; opt_clean; tee -o $work/stat stat -liberty $cells" > "$work/log" 2>&1) || {
        [ $? = 124 ] || { cat "$work/log" >&2; exit 1; }
        echo - -
        return
    }
    awk '/ DFFPOSX1 / { registers = $2 } /Chip area/ { area = $NF } END { printf "%.0f %d\n", (area - 96 * registers) / 24, registers }' "$work/stat"
}

# machine, unit: gates, and the gates of logic
model() {
    awk -v unit="$2" '
        FNR == NR { gates = gates || /"gates"/; if (gates && !price && match($1, /"register"/)) price = $2 + 0; next }
        $1 == unit { gsub(",", ""); printf "%d %.0f\n", $(NF - 5), $(NF - 5) - $(NF - 1) * price }' "$work/prices" "$work/$1.cost"
}

"$splatsim" machine prices > "$work/prices"
printf '%-10s %-9s %8s %8s %8s %5s %6s\n' machine unit gates logic model ratio FFs
for file; do
    machine=$(basename "$file" .json)
    # Only the package and the ROMs of the trace are used.
    "$splatsim" trace glass-spheres --size 16x16 --stimulus 1 --machine "$file" $sets --quiet --out "$work/$machine" > /dev/null
    "$splatsim" machine cost "$file" $sets > "$work/$machine.cost"
    for unit in $(echo "$units" | tr , ' '); do
        read -r gates model << END_OF_MODEL
$(model "$machine" "$unit")
END_OF_MODEL
        read -r logic registers << END_OF_TWIN
$(synthesise "$machine" "$unit")
END_OF_TWIN
        awk -v machine="$machine" -v unit="$unit" -v gates="$gates" -v logic="$logic" -v model="$model" -v registers="$registers" 'BEGIN {
            ratio = logic == "-" ? "-" : sprintf("%.2f", logic / model)
            printf "%-10s %-9s %8s %8s %8s %5s %6s\n", machine, unit, gates, logic, model, ratio, registers }'
        echo "$logic $model" >> "$work/fit"
    done
done
awk '$1 != "-" && $1 * $2 > 0 {
        ratio = $1 / $2
        if (!n++ || ratio < least) least = ratio
        if (ratio > most) most = ratio
        sum += log(ratio)
    }
    END { if (n) printf "%d units: logic over model %.2f in the geometric mean, %.2f to %.2f\n", n, exp(sum / n), least, most }' "$work/fit"
