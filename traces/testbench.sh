#!/bin/sh
# Drives the recorded trace into the raster's RTL implementation, and writes its outputs into a file
# for `splatsim diff`.
# Usage: sh traces/testbench.sh [FILE]; the default FILE is target/testbench/raster.out.hex. Needs
# Icarus Verilog (Debian: iverilog).
set -eu
here=$(cd "$(dirname "$0")" && pwd)
out=${1:-$here/../target/testbench/raster.out.hex}
mkdir -p "$(dirname "$out")"
out=$(cd "$(dirname "$out")" && pwd)/$(basename "$out")
cd "$here/knot"
program=$(mktemp)
trap 'rm -f "$program"' EXIT
iverilog -g2012 -o "$program" -s testbench -P "testbench.IN_RECORDS=$(wc -l < raster.in.hex)" \
    -P "testbench.OUT_RECORDS=$(wc -l < raster.out.hex)" -y ../../rtl_model/rtl -Y .sv machine_pkg.sv ../testbench.sv
vvp -n "$program" "+out=$out"
echo "written to $out: splatsim diff traces/knot raster.out $out"
