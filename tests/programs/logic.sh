# Shell, sourced by area.sh, delays.sh, depths.sh and gates.sh: the units' own logic. Writes
# $work/pipe.sv, in which wires replace the registers and the FIFO behind each unit, and sets
# $sources: this file and all units of $rtl with their parts.
cat > "$work/pipe.sv" << 'END'
module pipe #(parameter int W = 1, parameter int LATENCY = 1, parameter int INTERVAL = 1, parameter int ROOM = 1) (
    input wire clk, input wire rst, input wire s_valid, output wire s_ready, input wire s_keeps, input wire [W-1:0] s_data,
    output wire m_valid, input wire m_ready, output wire [W-1:0] m_data
);
  assign {s_ready, m_valid, m_data} = {m_ready, s_valid, s_data};
endmodule
END
sources=$work/pipe.sv
for source in delay dot ellipse ellipse_footprint ellipse_normal ellipse_plane ellipse_size ellipse_turn ellipse_visibility fifo fit fit_shifted \
    fragment fragment_hazard fragment_late fragment_lit fragment_opaque fragment_over fragment_read fragment_sum gauss lookup normalise \
    project raster raster_skip reciprocal reciprocal_root resolve shade shade_cosine sheets sheets_close windows windows_close windows_dimmed \
    windows_inside windows_late windows_least windows_quotient windows_rest windows_splat windows_sum; do
    sources="$sources $rtl/$source.sv"
done
