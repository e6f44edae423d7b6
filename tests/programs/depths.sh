#!/bin/sh
# Counts the gates between the registers of the RTL implementations, and computes the clock that
# they allow. Synthesises each unit (rtl_model/rtl) to gates with two inputs and multiplexers with
# Yosys (Debian: yosys), and counts them. Then maps it to the open 180 nm cells of Debian's
# qflow-tech-osu018 with ABC, optimised for speed.
#
#   depths.sh [--splatsim BINARY] [--units UNIT,...] [--gates] [MACHINE...]
#
# For each machine (by default tiny, lean and reference; window, volume and gaussian are possible
# too) and unit (gauss, resolve, raster, and fragment or its replacement) it prints:
#   gates      gates of the critical path; inverters do not count
#   cycles     the latency with a register behind every operator (timing.technology=ideal)
#   a stage    gates per stage, if the path's registers divide it evenly
#   loop       gates per register of the longest loop, which moving registers cannot shorten
#   ready      gates from an input to s_ready, which a handshake adds to the loops of other units
#   ps, ps     picoseconds of a stage, and of the longest path between two registers of a loop
#              without moving registers
#   MHz        the clock that the longer of these allows, with 5 FO4 for a register
# With --gates the last three columns are left out. A path through a chain of registers, such as the
# path of a place that is given back, has spare registers: it counts for loop, but not for the
# picoseconds.
set -euf
here=$(cd "$(dirname "$0")" && pwd)
rtl=$here/../../rtl_model/rtl
splatsim=$here/../../target/release/splatsim
cells=/usr/share/qflow/tech/osu018/osu018_stdcells.lib
units=gauss,resolve,raster,fragment
delays=yes
while [ $# -gt 0 ]; do
    case $1 in
        --splatsim) splatsim=$(realpath "$2"); shift 2 ;;
        --units) units=$2; shift 2 ;;
        --gates) delays=no; shift ;;
        -*) echo "depths.sh: what is $1?" >&2; exit 2 ;;
        *) break ;;
    esac
done
[ $# -gt 0 ] || set -- tiny lean reference
[ $delays = no ] || [ -f $cells ] || { echo "depths.sh: $cells is missing: apt-get install qflow-tech-osu018" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
trap 'exit 1' INT TERM
. "$here/logic.sh"
# Yosys 0.23 derives a part of windows twice if parameters are given on the command line. The
# parameters are therefore written into the source as defaults.
sed 's/int WIDTH = 16,/int WIDTH = 2,/; s/int HEIGHT = 16,/int HEIGHT = 2,/' "$rtl/windows.sv" > "$work/windows.sv"
sources=$(echo "$sources" | sed "s|$work/pipe.sv|$rtl/pipe.sv|; s|$rtl/windows.sv|$work/windows.sv|")

# machine, commands of Yosys; its output is printed only if it fails
with_yosys() {
    (cd "$work/$1" && yosys -q -p "$2" > yosys.log 2>&1) || { cat "$work/$1/yosys.log" >&2; exit 1; }
}

# machine, what Yosys reads: picoseconds of the critical path, mapped for speed, with sized gates
picoseconds() {
    with_yosys "$1" "$2; tee -o abc.log abc -liberty $cells -script $here/fastest.abc"
    sed -n 's/.*Delay = *\([0-9.]*\) ps.*/\1/p' "$work/$1/abc.log" | sort -rn | sed -n 1p
}

printf '%-10s %-9s %6s %6s %8s %6s %6s' machine unit gates cycles 'a stage' loop ready
[ $delays = no ] || printf ' %7s %7s %5s' ps ps MHz
printf '\n'
for file; do
    machine=$(basename "$file" .json)
    scene=glass-spheres grouper=fragment
    case $machine in
        window) grouper=windows ;;
        volume) scene=nested-shells grouper=sheets ;;
        gaussian) scene=bouquet grouper=sheets ;;
    esac
    # Only the package and the ROMs of the trace are used.
    "$splatsim" trace $scene --size 16x16 --stimulus 1 --machine "$file" --set 'timing.raster.lanes=[1,1]' --set timing.technology=ideal --quiet --out "$work/$machine" > /dev/null
    for unit in $(echo "$units" | tr , ' '); do
        parameters= of=$unit
        [ "$unit" != fragment ] || unit=$grouper parameters="-chparam WIDTH 2 -chparam HEIGHT 2"
        [ "$unit" != windows ] || parameters=
        [ "$unit" != raster ] || parameters="-chparam TAG_W 1 -chparam SIDE 16"
        cycles=$(sed -n "s/.* $(echo "$of" | tr a-z A-Z)_LATENCY = \([0-9]*\);/\1/p" "$work/$machine/machine_pkg.sv")
        with_yosys "$machine" "read_verilog -sv machine_pkg.sv; read_verilog -sv -defer $sources; hierarchy -top $unit $parameters; synth -flatten -top $unit; rename -top top; write_json top.json"
        read -r gates loop ready << END_OF_DEPTHS
$(python3 "$here/depths.py" "$work/$machine/top.json" top "$work/$machine/loop.txt")
END_OF_DEPTHS
        printf '%-10s %-9s %6s %6s %8s %6s %6s' "$machine" "$unit" "$gates" "$cycles" $(((gates + cycles - 1) / cycles)) "$loop" "$ready"
        if [ $delays = yes ]; then
            whole=$(picoseconds "$machine" "read_json top.json; dfflibmap -liberty $cells")
            looped=$(picoseconds "$machine" "read_json top.json; select -read loop.txt; setattr -set submod \"loop\" %; select -clear; submod; cd top_loop")
            awk -v whole="$whole" -v cycles="$cycles" -v loop="$looped" 'BEGIN {
                stage = whole / cycles
                printf " %7.0f %7.0f %5.0f", stage, loop, 1e6 / ((stage > loop ? stage : loop) + 5 * 98)
            }'
        fi
        printf '\n'
    done
done
