// Reflect_line: interpolates light between two texels. RTL implementation of Map::line in
// functions/map.rs.
//
//   from + (to - from) * fraction ->[ fit ]-> light
//
// Loss: each channel is rounded to the texels' own word; it is always in its range.
`timescale 1ns / 1ps
`default_nettype none

module reflect_line (
    input wire [3*machine_pkg::REFLECT_LIGHT_W-1:0] from,         // a texel: red, green, blue, the first in the most significant bits
    input wire [3*machine_pkg::REFLECT_LIGHT_W-1:0] to,           // the next one
    input wire [machine_pkg::REFLECT_FRACTION_W-1:0] fraction,    // from 0 to 1
    output wire [3*machine_pkg::REFLECT_LIGHT_W-1:0] light        // between them
);
  localparam int LIGHT_W = machine_pkg::REFLECT_LIGHT_W;
  localparam int FRACTION_W = machine_pkg::REFLECT_FRACTION_W;
  localparam int FRACTION_F = machine_pkg::REFLECT_FRACTION_F;
  localparam int EXACT_W = LIGHT_W + FRACTION_W + 2;

  for (genvar channel = 0; channel < 3; channel++) begin : g_channel
    wire signed [LIGHT_W:0] start = {1'b0, from[channel*LIGHT_W+:LIGHT_W]};
    wire signed [LIGHT_W:0] finish = {1'b0, to[channel*LIGHT_W+:LIGHT_W]};
    wire signed [LIGHT_W:0] step = finish - start;
    wire signed [FRACTION_W:0] part = {1'b0, fraction};
    wire signed [EXACT_W-1:0] rise = step * part;
    wire signed [EXACT_W-1:0] exact = (EXACT_W'(start) <<< FRACTION_F) + rise;
    fit #(.IN_W(EXACT_W), .PLACES(FRACTION_F), .W(LIGHT_W), .S(0), .ROUND(machine_pkg::REFLECT_LIGHT_ROUND),
        .WRAP(machine_pkg::REFLECT_LIGHT_WRAP)) between (.exact(exact), .word(light[channel*LIGHT_W+:LIGHT_W]));
  end
endmodule

`default_nettype wire
