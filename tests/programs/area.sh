#!/bin/sh
# What the units take in a real technology, beside what the cost model says: synthesises the SystemVerilog of each unit (rtl_model/rtl)
# for a Xilinx 7, first with multipliers of LUTs, as the model counts them, then with DSPs. Needs Yosys (Debian: yosys).
#
#   area.sh [--splatsim BINARY] [--set PATH=VALUE]... [--units UNIT,...] [--seconds N] [--jobs 1|2] [--ice40] [MACHINE...]
#
# For each machine (tiny, lean, reference) and unit prints:
#   LUTs          of any width, with multipliers of LUTs (-nodsp -nowidelut: as in operators.sh)
#   model         LUT equivalents of `splatsim machine cost`; registers: that part of them which is flip-flops, two to a LUT
#   ratio         LUTs by what the model has without registers
#   LUTs+DSP, DSP the same with DSPs; LUTs/DSP: how many LUTs each DSP saves
#   FD            flip-flops
# With --ice40 instead LUTs of four inputs, flip-flops, and the ratio to the same model, which counts LUTs of six.
#
# Only a unit's own logic is synthesised:
# - The pipe behind each unit is replaced by wires: neither the registers of its latency, which synthesis would retime into the logic and
#   which the model counts one for each word, nor the FIFO, which the model counts apart. What FDs are left are state: of the raster's walk,
#   of the resolver's sums, of the fragment's look-up, hazards and writes (-nosrl: none of them is hidden in a LUT).
# - The fragment unit keeps 2 by 2 pixels, in LUT memories (RAM*), which are not counted.
# - The raster has one lane, its tag, which the model counts with the FIFOs, one bit. There is one light, and two materials.
# - The picture's constants, lights and materials are inputs: synthesis cannot fold them.
# A synthesis that takes longer than --seconds (180) is left out: `-`.
set -euf
here=$(cd "$(dirname "$0")" && pwd)
rtl=$here/../../rtl_model/rtl
splatsim=$here/../../target/release/splatsim
units=project,ellipse,raster,gauss,fragment,shade,resolve
sets="--set timing.raster.lanes=[1,1]"
seconds=180
jobs=1
family=xilinx
while [ $# -gt 0 ]; do
    case $1 in
        --splatsim) splatsim=$(realpath "$2"); shift 2 ;;
        --set) sets="$sets --set $2"; shift 2 ;;
        --units) units=$2; shift 2 ;;
        --seconds) seconds=$2; shift 2 ;;
        --jobs) jobs=$2; shift 2 ;;
        --ice40) family=ice40; shift ;;
        -*) echo "area.sh: what is $1?" >&2; exit 2 ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || set -- tiny lean reference
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat > "$work/pipe.sv" << 'END'
module pipe #(parameter int W = 1, parameter int LATENCY = 1, parameter int INTERVAL = 1, parameter int ROOM = 1) (
    input wire clk, input wire rst, input wire s_valid, output wire s_ready, input wire [W-1:0] s_data,
    output wire m_valid, input wire m_ready, output wire [W-1:0] m_data
);
  assign {s_ready, m_valid, m_data} = {m_ready, s_valid, s_data};
endmodule
END
sources=$work/pipe.sv
for source in dot ellipse fifo fit fit_shifted fragment fragment_lit fragment_opaque fragment_over fragment_sum gauss lookup normalise \
    project raster reciprocal reciprocal_root resolve shade shade_cosine; do
    sources="$sources $rtl/$source.sv"
done

# machine, unit, name of the run, synthesis
synthesise() {
    case $2 in
        fragment) parameters="-chparam WIDTH 2 -chparam HEIGHT 2" ;;
        raster) parameters="-chparam TAG_W 1" ;;
        *) parameters= ;;
    esac
    stat=$work/$1.$2.$3
    # ROMs are found from the trace's folder.
    (cd "$work/$1" && timeout "$seconds" yosys -q -p "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer $sources
        hierarchy -top $2 $parameters; $4; tee -o $stat.part stat" > "$stat.log" 2>&1 && mv "$stat.part" "$stat") || {
        [ $? = 124 ] || { cat "$stat.log" >&2; exit 1; }
    }
}

# machine, unit, name of the run, regular expression: how many cells have a name like that, or -
cells() {
    [ -f "$work/$1.$2.$3" ] || { echo -; return; }
    awk -v like="$4" 'NF == 2 && $1 ~ like && $2 ~ /^[0-9]+$/ { n += $2 } END { print n + 0 }' "$work/$1.$2.$3"
}

# machine, unit: LUT equivalents, and those of them that are registers
model() {
    awk -v unit="$2" '$1 == unit { gsub(",", ""); print $2, $(NF - 1) / 2 }' "$work/$1.cost"
}

# numerator, denominator, digits
ratio() {
    awk -v a="$1" -v b="$2" -v digits="$3" 'BEGIN { if (a == "-" || b == "-" || b == 0) print "-"; else printf "%.*f\n", digits, a / b }'
}

xilinx="synth_xilinx -family xc7 -flatten -nowidelut -noiopad -nosrl"
case $family in
    xilinx) printf '%-10s %-9s %7s %7s %9s %6s %9s %5s %9s %6s\n' machine unit LUTs model registers ratio LUTs+DSP DSP LUTs/DSP FD ;;
    ice40) printf '%-10s %-9s %7s %7s %9s %6s %6s\n' machine unit LUTs model registers ratio FD ;;
esac
for machine; do
    file=$machine
    machine=$(basename "$file" .json)
    # Of the trace only the package and the ROMs matter.
    "$splatsim" trace glass-spheres --size 16x16 --stimulus 1 --machine "$file" $sets --quiet --out "$work/$machine" > /dev/null
    "$splatsim" machine cost "$file" $sets > "$work/$machine.cost"
    for unit in $(echo "$units" | tr , ' '); do
        model=$(model "$machine" "$unit")
        registers=${model#* }
        model=${model% *}
        logic=$(awk -v model="$model" -v registers="$registers" 'BEGIN { print model - registers }')
        if [ $family = ice40 ]; then
            synthesise "$machine" "$unit" ice40 synth_ice40
            luts=$(cells "$machine" "$unit" ice40 '^SB_LUT4$')
            printf '%-10s %-9s %7s %7s %9.0f %6s %6s\n' "$machine" "$unit" "$luts" "$model" "$registers" "$(ratio "$luts" "$logic" 2)" \
                "$(cells "$machine" "$unit" ice40 '^SB_DFF')"
            continue
        fi
        if [ "$jobs" -gt 1 ]; then
            synthesise "$machine" "$unit" luts "$xilinx -nodsp" &
            synthesise "$machine" "$unit" dsps "$xilinx"
            wait
        else
            synthesise "$machine" "$unit" luts "$xilinx -nodsp"
            synthesise "$machine" "$unit" dsps "$xilinx"
        fi
        luts=$(cells "$machine" "$unit" luts '^LUT[1-6]$')
        with=$(cells "$machine" "$unit" dsps '^LUT[1-6]$')
        dsps=$(cells "$machine" "$unit" dsps '^DSP48E1$')
        [ "$luts" = - ] || [ "$with" = - ] && saved=- || saved=$((luts - with))
        printf '%-10s %-9s %7s %7s %9.0f %6s %9s %5s %9s %6s\n' "$machine" "$unit" "$luts" "$model" "$registers" \
            "$(ratio "$luts" "$logic" 2)" "$with" "$dsps" "$(ratio "$saved" "$dsps" 0)" "$(cells "$machine" "$unit" dsps '^FD')"
    done
done
