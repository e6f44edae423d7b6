#!/bin/sh
# Compares the delays of operators and units in real standard cells with the model of the clock.
# Maps each to the open 180 nm cells of Debian's package qflow-tech-osu018 with Yosys (Debian:
# yosys) and ABC, optimised for speed, and prints its critical path.
#
#   delays.sh [--splatsim BINARY] [--units UNIT,...] [MACHINE...]
#
# First it prints operators: picoseconds, FO4 (the delay of a fanout-of-4 inverter INVX1 of the same
# cells), and FO4 by the model. If machines are given, it then prints the units of each: the
# SystemVerilog of the unit (rtl_model/rtl) without the registers of its stages, so that the result
# is the critical path from an input or a state to an output or a state. ABC balances every path,
# and does not model wires.
set -euf
here=$(cd "$(dirname "$0")" && pwd)
rtl=$here/../../rtl_model/rtl
splatsim=$here/../../target/release/splatsim
cells=/usr/share/qflow/tech/osu018/osu018_stdcells.lib
units=gauss,resolve,raster,fragment,project,ellipse,shade
while [ $# -gt 0 ]; do
    case $1 in
        --splatsim) splatsim=$(realpath "$2"); shift 2 ;;
        --units) units=$2; shift 2 ;;
        -*) echo "delays.sh: what is $1?" >&2; exit 2 ;;
        *) break ;;
    esac
done
[ -f $cells ] || { echo "delays.sh: $cells is missing: apt-get install qflow-tech-osu018" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM

# what is read, preceding commands: picoseconds of the critical path, mapped for speed, with sized
# gates
picoseconds() {
    (cd "$work" && yosys -q -p "$1; $2; dfflibmap -liberty $cells; tee -o abc.log abc -liberty $cells -script $here/fastest.abc" > /dev/null 2> err) || { cat "$work/err" >&2; exit 1; }
    # The longest of all modules of logic.
    sed -n 's/.*Delay = *\([0-9.]*\) ps.*/\1/p' "$work/abc.log" | sort -rn | sed -n 1p
}

# name, width, verilog, FO4 of the model
operator() {
    printf '%s\n' "$3" > "$work/top.v"
    ps=$(picoseconds "read_verilog top.v" "synth -flatten -top top")
    awk -v n="$1" -v w="$2" -v ps="$ps" -v fo4="$fo4" -v m="$4" 'BEGIN { printf "%-12s %5s %8.0f %7.1f %7.1f %6.2f\n", n, w, ps, ps / fo4, m, ps / fo4 / m }'
}

# The model (rtl_model/src/elaboration/latency.rs), in FO4.
model() {
    awk -v what="$1" -v a="$2" -v b="${3:-$2}" '
        function log2(n, p) { p = 1; l = 0; while (2 * p <= n) { p *= 2; l++ }; return l + int(16 * (n - p) / p) / 16 }
        function most(x) { return x > 0 ? x : 0 }
        function adder(n) { return most(3.5 * log2(n) - 2.6) }
        BEGIN {
            if (what == "adder") print adder(a)
            if (what == "multiplier") print most(7.5 * log2(a < b ? a : b) - 10.5) + adder(a + b)
            if (what == "shifter") print 1.6 * log2(a)
            if (what == "table") print 0.5 + 1.2 * a
        }'
}

# An INVX1 has 9.3 fF at its input. With a load of 37.3 fF and the slope of its own output its delay
# is 92 ps falling and 105 ps rising, by its tables.
fo4=98
printf '%-12s %5s %8s %7s %7s %6s\n' operator bits ps FO4 model ratio
for w in 8 16 32 48; do
    operator adder $w "module top(input [$((w - 1)):0] a, b, output [$w:0] y); assign y = a + b; endmodule" "$(model adder $w)"
done
for w in 8 12 18 27; do
    operator multiplier "$w" "module top(input signed [$((w - 1)):0] a, b, output signed [$((2 * w - 1)):0] y); assign y = a * b; endmodule" "$(model multiplier $w)"
done
operator multiplier 24x12 "module top(input signed [23:0] a, input signed [11:0] b, output signed [35:0] y); assign y = a * b; endmodule" "$(model multiplier 24 12)"
for w in 16 32; do
    stages=$(awk -v w=$w 'BEGIN { print int(log(w) / log(2) + 0.999) }')
    operator shifter $w "module top(input [$((w - 1)):0] a, input [$((stages - 1)):0] s, output [$((w - 1)):0] y); assign y = a << s; endmodule" "$(model shifter $w)"
done
for a in 5 8; do
    words=$(awk -v a=$a 'BEGIN { srand(1); for (i = 0; i < 2 ^ a; i++) printf "%d: y = 12'"'"'d%d; ", i, 4095 * exp(-i / 2 ^ a * 4) }')
    operator table $a "module top(input [$((a - 1)):0] i, output reg [11:0] y); always @* case (i) $words default: y = 0; endcase endmodule" "$(model table $a)"
done
[ $# -gt 0 ] || exit 0

. "$here/logic.sh"
printf '\n%-10s %-9s %8s %7s %7s %6s\n' machine unit ps FO4 model ratio
for file; do
    machine=$(basename "$file" .json)
    "$splatsim" trace glass-spheres --size 16x16 --stimulus 1 --machine "$file" --set 'timing.raster.lanes=[1,1]' --quiet --out "$work/$machine" > /dev/null
    "$splatsim" machine clock "$file" > "$work/$machine.clock"
    for unit in $(echo "$units" | tr , ' '); do
        parameters=
        [ "$unit" != fragment ] || parameters="-chparam WIDTH 2 -chparam HEIGHT 2"
        [ "$unit" != raster ] || parameters="-chparam TAG_W 1 -chparam SIDE 16"
        # The ROMs are read relative to the trace's folder.
        ps=$(work=$work/$machine; picoseconds "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer $sources; hierarchy -top $unit $parameters" "synth -flatten -top $unit")
        fo4_of=$(awk -v row="$unit" '$1 == row { for (i = 2; i <= NF; i++) if ($i ~ /^[0-9.]+$/) { print $i; exit } }' "$work/$machine.clock")
        awk -v n="$machine" -v u="$unit" -v ps="$ps" -v fo4="$fo4" -v m="$fo4_of" 'BEGIN { printf "%-10s %-9s %8.0f %7.1f %7.1f %6.2f\n", n, u, ps, ps / fo4, m, ps / fo4 / m }'
    done
done
