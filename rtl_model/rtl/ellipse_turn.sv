// Ellipse_turn: inclination of a direction to its ray. RTL implementation of `turn` in
// units/ellipse.rs.
//
//   normal, a, b -+->[ x - a*z, y - b*z ]-> tilt g
//                 +->[ a*x + b*y + z ]----> facing c_n
//
// Loss: each word is rounded once.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_turn (
    input wire signed [machine_pkg::PROJECT_SLOPE_W-1:0] a,         // the ray, x/z
    input wire signed [machine_pkg::PROJECT_SLOPE_W-1:0] b,         // and y/z
    input wire [3*machine_pkg::ELLIPSE_NORMAL_W-1:0] normal,        // the direction, x in the most significant bits
    output wire signed [machine_pkg::ELLIPSE_TILT_W-1:0] tilt_x,    // g
    output wire signed [machine_pkg::ELLIPSE_TILT_W-1:0] tilt_y,    // likewise
    output wire signed [machine_pkg::ELLIPSE_FACING_W-1:0] facing   // c_n
);
  localparam int SLOPE_W = machine_pkg::PROJECT_SLOPE_W;
  localparam int SLOPE_F = machine_pkg::PROJECT_SLOPE_F;
  localparam int NORMAL_W = machine_pkg::ELLIPSE_NORMAL_W;
  localparam int NORMAL_F = machine_pkg::ELLIPSE_NORMAL_F;
  localparam int TILT_W = machine_pkg::ELLIPSE_TILT_W;
  localparam int TILT_F = machine_pkg::ELLIPSE_TILT_F;
  localparam int FACING_W = machine_pkg::ELLIPSE_FACING_W;
  localparam int FACING_F = machine_pkg::ELLIPSE_FACING_F;

  wire signed [NORMAL_W-1:0] normal_x = normal[2*NORMAL_W+:NORMAL_W];
  wire signed [NORMAL_W-1:0] normal_y = normal[NORMAL_W+:NORMAL_W];
  wire signed [NORMAL_W-1:0] normal_z = normal[0+:NORMAL_W];

  localparam int LEANED_F = SLOPE_F + NORMAL_F;
  localparam int LEANED_W = (SLOPE_W > SLOPE_F ? SLOPE_W : SLOPE_F) + NORMAL_W + 2;
  wire signed [LEANED_W-1:0] a_x = a * normal_x, a_z = a * normal_z, b_y = b * normal_y, b_z = b * normal_z;
  wire signed [LEANED_W-1:0] x = LEANED_W'(normal_x) <<< SLOPE_F, y = LEANED_W'(normal_y) <<< SLOPE_F;
  wire signed [LEANED_W-1:0] z = LEANED_W'(normal_z) <<< SLOPE_F;
  wire signed [LEANED_W-1:0] leaned_x = x - a_z, leaned_y = y - b_z, faced = a_x + b_y + z;
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - TILT_F), .W(TILT_W), .S(1), .ROUND(machine_pkg::ELLIPSE_TILT_ROUND),
      .WRAP(machine_pkg::ELLIPSE_TILT_WRAP)) fit_tilt_x (.exact(leaned_x), .word(tilt_x));
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - TILT_F), .W(TILT_W), .S(1), .ROUND(machine_pkg::ELLIPSE_TILT_ROUND),
      .WRAP(machine_pkg::ELLIPSE_TILT_WRAP)) fit_tilt_y (.exact(leaned_y), .word(tilt_y));
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - FACING_F), .W(FACING_W), .S(1), .ROUND(machine_pkg::ELLIPSE_FACING_ROUND),
      .WRAP(machine_pkg::ELLIPSE_FACING_WRAP)) fit_facing (.exact(faced), .word(facing));
endmodule

`default_nettype wire
