// Ellipse_normal: rotates a direction to camera space. RTL implementation of `camera_normal` in
// units/ellipse.rs.
//
//   vector ->[ W*n ]->[ fit ]-> normal
//
// Loss: each part is rounded once.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_normal (
    // Only the rotation is used of the frame's constants.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                // constants: the view
    // verilator lint_on UNUSEDSIGNAL
    input wire [3*machine_pkg::SPLAT_NORMAL_W-1:0] vector,      // x, y, z, x in the most significant bits; in world space
    output wire [3*machine_pkg::ELLIPSE_NORMAL_W-1:0] normal    // likewise, in camera space
);
  localparam int WORLD_W = machine_pkg::SPLAT_NORMAL_W;
  localparam int ROTATION_W = machine_pkg::PROJECT_ROTATION_W;
  localparam int NORMAL_W = machine_pkg::ELLIPSE_NORMAL_W;
  localparam int NORMAL_F = machine_pkg::ELLIPSE_NORMAL_F;

  for (genvar i = 0; i < 3; i++) begin : g_normal
    wire signed [ROTATION_W+WORLD_W:0] rotated;
    wire signed [NORMAL_W-1:0] part;
    dot #(.A_W(ROTATION_W), .B_W(WORLD_W)) rotate (.a(frame[machine_pkg::FRAME_ROTATION_22_LSB+i*3*ROTATION_W+:3*ROTATION_W]),
        .b(vector), .sum(rotated));
    fit #(.IN_W(ROTATION_W + WORLD_W + 1), .PLACES(machine_pkg::PROJECT_ROTATION_F + machine_pkg::SPLAT_NORMAL_F - NORMAL_F), .W(NORMAL_W),
        .S(1), .ROUND(machine_pkg::ELLIPSE_NORMAL_ROUND), .WRAP(machine_pkg::ELLIPSE_NORMAL_WRAP))
        fit_normal (.exact(rotated), .word(part));
    assign normal[i*NORMAL_W+:NORMAL_W] = part;
  end
endmodule

`default_nettype wire
