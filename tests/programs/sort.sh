#!/bin/sh
# Compares the datapath of a radix sort with the cost model of the unit `sort`: synthesises it for a
# Xilinx 7 at several widths of key and digit. Memory is outside: a count is read and written, an
# entry is read and written.
#
#   sort.sh [--splatsim BINARY]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
splatsim=$here/../../target/release/splatsim
[ "${1:-}" != --splatsim ] || splatsim=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# key bits, digit bits
synthesise() {
    cat > "$work/top.v" << VERILOG
// One entry a cycle: the entry that is moved goes to the next place of its digit's value; of the entry that is counted, the next digit's
// value is counted for the pass after.
module top #(parameter KEY = $1, DIGIT = $2, PASSES = (KEY + DIGIT - 1) / DIGIT) (
    input clock, input [\$clog2(PASSES + 1) - 1:0] pass, input adds_up,
    input [31 + KEY:0] entry, input [31:0] place, count,
    output reg [31 + KEY:0] moved, output [DIGIT - 1:0] of_place, of_count, output [31:0] next_place, next_count
);
    reg [31 + KEY:0] read;
    wire [PASSES * DIGIT - 1:0] moving = read[KEY - 1:0], counted = entry[KEY - 1:0];
    wire [DIGIT - 1:0] digit [0:PASSES], next [0:PASSES];
    always @(posedge clock) begin
        read <= entry;
        moved <= read;
    end
    // The least digit where no pass is named: of the first count, too.
    assign digit[PASSES] = moving[DIGIT - 1:0];
    assign next[PASSES] = counted[DIGIT - 1:0];
    genvar nth;
    for (nth = 0; nth < PASSES; nth = nth + 1) begin
        assign digit[nth] = pass == nth ? moving[nth * DIGIT +: DIGIT] : digit[nth + 1];
        assign next[nth] = pass == nth - 1 ? counted[nth * DIGIT +: DIGIT] : next[nth + 1];
    end
    assign of_place = digit[0];
    assign of_count = next[0];
    assign next_place = place + 1;
    assign next_count = count + (adds_up ? place : 32'd1);
endmodule
VERILOG
    yosys -q -p "read_verilog -sv $work/top.v; synth_xilinx -family xc7 -flatten -nodsp -nowidelut -noiopad; tee -o $work/stat stat" > "$work/log" 2>&1 ||
        { cat "$work/log" >&2; exit 1; }
    synthesised=$(awk '/ LUT[1-6] / { luts += $2 } / FDRE / { flops += $2 } END { printf "%d %d", luts, flops }' "$work/stat")
    model=$("$splatsim" machine cost gaussian --set "sort.key=U4F$(($1 - 4))" --set "sort.digit_bits=$2" --set "project.depth=U5F24" |
        awk '$1 == "sort" { print $2; exit }')
    # A flip-flop is half a LUT.
    echo "$1 $2 $synthesised $model" |
        awk '{ area = $3 + $4 / 2; printf "%3d %5d %5d %10d %11.0f %6d %6.2f\n", $1, $2, $3, $4, area, $5, area / $5 }'
}

echo "key digit  LUTs flip-flops synthesised  model  ratio"
for key in 12 16 24 28; do
    for digit in 4 8; do synthesise $key $digit; done
done
