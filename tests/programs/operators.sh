#!/bin/sh
# Measures the operators of the cost model in a real technology: synthesises each alone, at several
# widths, for a Xilinx 7. Needs Yosys (Debian: yosys). Prints LUTs, and LUTs by the operator's own
# measure: bits, or bits times bits.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# name, measure, verilog
synthesise() {
    printf '%s\n' "$3" > "$work/top.v"
    yosys -q -p "read_verilog $work/top.v; synth_xilinx -family xc7 -flatten -nodsp -nowidelut -noiopad; tee -o $work/stat stat" > /dev/null
    luts=$(awk '/ LUT[1-6] / { n += $2 } END { print n + 0 }' "$work/stat")
    awk -v name="$1" -v luts="$luts" -v measure="$2" 'BEGIN { printf "%-12s %6d %6d %8.2f\n", name, measure, luts, luts / measure }'
}

printf '%-12s %6s %6s %8s\n' operator size LUTs LUTs/size
for w in 8 12 18 27; do
    synthesise multiplier $((w * w)) "module top(input signed [$((w - 1)):0] a, b, output signed [$((2 * w - 1)):0] y); assign y = a * b; endmodule"
done
for w in 12 24 36; do
    synthesise adder $w "module top(input [$((w - 1)):0] a, b, output [$w:0] y); assign y = a + b; endmodule"
    synthesise comparator $w "module top(input [$((w - 1)):0] a, b, output y); assign y = a < b; endmodule"
    synthesise multiplexer $w "module top(input [$((w - 1)):0] a, b, input s, output [$((w - 1)):0] y); assign y = s ? a : b; endmodule"
done
for w in 16 32; do
    stages=$(awk -v w=$w 'BEGIN { print int(log(w) / log(2) + 0.999) }')
    synthesise shifter $((w * stages)) "module top(input [$((w - 1)):0] a, input [$((stages - 1)):0] s, output [$((w - 1)):0] y); assign y = a << s; endmodule"
done
for a in 6 8; do
    words=$(awk -v a=$a 'BEGIN { srand(1); for (i = 0; i < 2 ^ a; i++) printf "%d: y = 12'"'"'d%d; ", i, 4095 * exp(-i / 2 ^ a * 4) }')
    synthesise rom $((12 << a)) "module top(input [$((a - 1)):0] i, output reg [11:0] y); always @* case (i) $words default: y = 0; endcase endmodule"
done
