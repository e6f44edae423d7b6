#!/bin/sh
# Plays the recorded trace into the raster's twin. Needs Icarus Verilog (Debian: iverilog).
set -eu
cd "$(dirname "$0")/knot"
program=$(mktemp)
trap 'rm -f "$program"' EXIT
iverilog -g2012 -o "$program" -s testbench -P "testbench.IN_RECORDS=$(wc -l < raster.in.hex)" \
    -P "testbench.OUT_RECORDS=$(wc -l < raster.out.hex)" -y ../../rtl_model/rtl -Y .sv machine_pkg.sv ../testbench.sv
vvp -n "$program"
