#!/bin/sh
# Compares the LUTs of the units on a real FPGA with the cost model. Synthesises the SystemVerilog
# of each unit (rtl_model/rtl) for a Xilinx 7: once with multipliers in LUTs, as the model counts
# them, and once with DSPs. Needs Yosys (Debian: yosys).
#
#   area.sh [--splatsim BINARY] [--set PATH=VALUE]... [--units UNIT,...] [--seconds N]
#           [--jobs 1|2] [--without-dsps] [--ice40] [MACHINE...]
#
# For each machine (tiny, lean, reference) and unit it prints:
#   area              LUT equivalents, as `splatsim machine cost` gives them
#   LUTs model ratio  LUTs of any width with multipliers in LUTs (-nodsp -nowidelut: as in
#                     operators.sh); area without registers
#   LUTs DSPs rest ratio  the same with DSPs; area without registers and multipliers
#   FDs               flip-flops
# The last lines are the geometric mean of LUTs over model, and its range. With --without-dsps the
# four columns about DSPs are missing. With --ice40 they are missing too, and LUTs have four inputs,
# compared with the same model, which counts LUTs with six inputs.
#
# The default unit costs are round numbers near the least squares of relative errors over the units
# of tiny and lean. Over these, reference and two more machines (34 units), the mean of LUTs over
# model is 1.00, and the range 0.89 to 1.22 (docs/book/cost.md).
#
# Only a unit's own logic is synthesised:
# - The pipe behind each unit is replaced by wires. It contains the registers of the latency, which
#   synthesis would retime into the logic and of which the model counts one per word, and the FIFO,
#   which the model counts separately. The remaining FDs are state: of the raster's walk, of the
#   resolver's sums, of the fragment's look-up, hazards and writes (-nosrl: none of them is hidden
#   in a LUT).
# - The fragment unit keeps 2 by 2 pixels. If they are in LUT memories (RAM*), they are not counted.
# - The raster has one lane and one bit of its tag, which the model counts with the FIFOs. It clips
#   boxes to tiles of 16 by 16 pixels. There is one light, and there are two materials.
# - The frame's constants, lights and materials are inputs, so that synthesis cannot fold them.
# A synthesis that takes longer than --seconds (180) is left out: `-`.
set -euf
here=$(cd "$(dirname "$0")" && pwd)
rtl=$here/../../rtl_model/rtl
splatsim=$here/../../target/release/splatsim
units=project,ellipse,raster,gauss,fragment,shade,resolve
sets="--set timing.raster.lanes=[1,1]"
seconds=180
jobs=1
dsps=yes
family=xilinx
while [ $# -gt 0 ]; do
    case $1 in
        --splatsim) splatsim=$(realpath "$2"); shift 2 ;;
        --set) sets="$sets --set $2"; shift 2 ;;
        --units) units=$2; shift 2 ;;
        --seconds) seconds=$2; shift 2 ;;
        --jobs) jobs=$2; shift 2 ;;
        --without-dsps) dsps=no; shift ;;
        --ice40) family=ice40; shift ;;
        -*) echo "area.sh: what is $1?" >&2; exit 2 ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || set -- tiny lean reference
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM

. "$here/logic.sh"

# machine, unit, name of the run, synthesis
synthesise() {
    case $2 in
        fragment) parameters="-chparam WIDTH 2 -chparam HEIGHT 2" ;;
        raster) parameters="-chparam TAG_W 1 -chparam SIDE 16" ;;
        *) parameters= ;;
    esac
    stat=$work/$1.$2.$3
    # The ROMs are read relative to the trace's folder.
    (cd "$work/$1" && timeout "$seconds" yosys -q -p "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer $sources
        hierarchy -top $2 $parameters; $4; tee -o $stat.part stat" > "$stat.log" 2>&1 && mv "$stat.part" "$stat") || {
        [ $? = 124 ] || cat "$stat.log" >&2
    }
}

# machine, unit, name of the run, regular expression: number of cells whose names match, or -
cells() {
    [ -f "$work/$1.$2.$3" ] || { echo -; return; }
    awk -v like="$4" 'NF == 2 && $1 ~ like && $2 ~ /^[0-9]+$/ { n += $2 } END { print n + 0 }' "$work/$1.$2.$3"
}

# machine, unit: area; without registers; without these and multipliers
model() {
    awk -v unit="$2" '
        FNR == 1 { file += 1 }
        # The first unit costs are those of the area.
        file == 1 && match($1, /^"[a-z]+":$/) { name = substr($1, 2, length($1) - 3); if (!(name in price)) price[name] = $2 + 0 }
        file == 2 && $1 == unit {
            gsub(",", "")
            rest = $(NF - 3) * price["adder"] + $(NF - 2) * price["multiplexer"] + $NF * price["rom"]
            printf "%d %.0f %.0f\n", $2, $2 - $(NF - 1) * price["register"], rest
        }' "$work/prices" "$work/$1.cost"
}

ratio() {
    awk -v a="$1" -v b="$2" 'BEGIN { if (a == "-" || b == 0) print "-"; else printf "%.2f\n", a / b }'
}

# machine, unit, area, LUTs, model, further columns: a row
row() {
    machine=$1 unit=$2 area=$3 luts=$4 model=$5
    shift 5
    printf '%-10s %-9s %7s  %7s %7s %5s' "$machine" "$unit" "$area" "$luts" "$model" "$(ratio "$luts" "$model")"
    [ $# -eq 1 ] || printf '  %7s %4s %6s %5s' "$1" "$2" "$3" "$(ratio "$1" "$3")"
    [ $# -eq 1 ] || shift 3
    printf '  %6s\n' "$1"
    echo "$luts $model" >> "$work/fit"
}

"$splatsim" machine prices > "$work/prices"
xilinx="synth_xilinx -family xc7 -flatten -nowidelut -noiopad -nosrl"
[ $family = xilinx ] || dsps=no
printf '%-10s %-9s %7s  %7s %7s %5s' machine unit area LUTs model ratio
[ $dsps = no ] || printf '  %7s %4s %6s %5s' LUTs DSPs rest ratio
printf '  %6s\n' FDs
for file; do
    machine=$(basename "$file" .json)
    # Only the package and the ROMs of the trace are used.
    "$splatsim" trace glass-spheres --size 16x16 --stimulus 1 --machine "$file" $sets --quiet --out "$work/$machine" > /dev/null
    "$splatsim" machine cost "$file" $sets > "$work/$machine.cost"
    for unit in $(echo "$units" | tr , ' '); do
        read -r area model rest << END
$(model "$machine" "$unit")
END
        if [ $family = ice40 ]; then
            synthesise "$machine" "$unit" luts synth_ice40
            row "$machine" "$unit" "$area" "$(cells "$machine" "$unit" luts '^SB_LUT4$')" "$model" "$(cells "$machine" "$unit" luts '^SB_DFF')"
            continue
        fi
        synthesise "$machine" "$unit" luts "$xilinx -nodsp" &
        [ "$jobs" -gt 1 ] || wait
        [ $dsps = no ] || synthesise "$machine" "$unit" dsps "$xilinx"
        wait
        luts=$(cells "$machine" "$unit" luts '^LUT[1-6]$')
        registers=$(cells "$machine" "$unit" luts '^FD')
        if [ $dsps = no ]; then
            row "$machine" "$unit" "$area" "$luts" "$model" "$registers"
        else
            with=$(cells "$machine" "$unit" dsps '^LUT[1-6]$')
            row "$machine" "$unit" "$area" "$luts" "$model" "$with" "$(cells "$machine" "$unit" dsps '^DSP48E1$')" "$rest" "$registers"
        fi
    done
done
awk '$1 != "-" && $1 * $2 > 0 {
        ratio = $1 / $2
        if (!n++ || ratio < least) least = ratio
        if (ratio > most) most = ratio
        sum += log(ratio)
    }
    END { if (n) printf "%d units: LUTs over model %.2f in the geometric mean, %.2f to %.2f\n", n, exp(sum / n), least, most }' "$work/fit"
