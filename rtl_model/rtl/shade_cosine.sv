// Shade's cosine: max(0, N.direction). RTL implementation of Shade::cosine in units/shade.rs.
//
// Loss: the cosine is rounded.
`timescale 1ns / 1ps
`default_nettype none

module shade_cosine (
    input wire [3*machine_pkg::SHADE_NORMAL_W-1:0] normal,   // N: x, y, z, the first in the most significant bits
    input wire [3*machine_pkg::SHADE_LIGHT_W-1:0] direction, // likewise
    output wire [machine_pkg::SHADE_COSINE_W-2:0] cosine     // never negative: without its sign
);
  localparam int NORMAL_W = machine_pkg::SHADE_NORMAL_W;
  localparam int LIGHT_W = machine_pkg::SHADE_LIGHT_W;
  localparam int COSINE_W = machine_pkg::SHADE_COSINE_W;
  localparam int EXACT_W = NORMAL_W + LIGHT_W + 1;

  wire signed [EXACT_W-1:0] exact;
  dot #(.A_W(NORMAL_W), .B_W(LIGHT_W)) projection (.a(normal), .b(direction), .sum(exact));
  wire signed [COSINE_W-1:0] word;
  fit #(.IN_W(EXACT_W), .PLACES(machine_pkg::SHADE_NORMAL_F + machine_pkg::SHADE_LIGHT_F - machine_pkg::SHADE_COSINE_F), .W(COSINE_W),
      .S(1), .ROUND(machine_pkg::SHADE_COSINE_ROUND), .WRAP(machine_pkg::SHADE_COSINE_WRAP)) projector (.exact(exact), .word(word));
  assign cosine = word[COSINE_W-1] ? '0 : word[COSINE_W-2:0];
endmodule

`default_nettype wire
