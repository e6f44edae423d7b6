// Fragment_opaque: whether a fragment hides everything behind it: it is opaque and covers the
// pixel. RTL implementation of units/fragment.rs, is_opaque. Opacity and weight are compared by
// products, because a quotient would have to be rounded.
`timescale 1ns / 1ps
`default_nettype none

module fragment_opaque (
    input wire shaded,                                                          // whether it is shaded
    input wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] weight,                 // its sum of weights
    input wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] opacity,               // its sum of opacities, or its opacity
    input wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] coverage_threshold,     // weight from which it covers the pixel
    output wire opaque                                                          // so it is
);
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int OPAQUE_W = machine_pkg::FRAGMENT_OPAQUE_W;
  // Left shifts that align both sides.
  localparam int LIMIT_F = machine_pkg::FRAGMENT_OPAQUE_F + machine_pkg::FRAGMENT_WEIGHT_SUM_F;
  localparam int OPACITY_F = machine_pkg::FRAGMENT_OPACITY_SUM_F;
  localparam int OF_OPACITY = LIMIT_F > OPACITY_F ? LIMIT_F - OPACITY_F : 0;
  localparam int OF_LIMIT = OPACITY_F > LIMIT_F ? OPACITY_F - LIMIT_F : 0;
  localparam int LEFT_W = OPACITY_W + OF_OPACITY;
  localparam int RIGHT_W = WEIGHT_W + OPAQUE_W + OF_LIMIT;
  localparam int COMPARED_W = LEFT_W > RIGHT_W ? LEFT_W : RIGHT_W;
  localparam int SHADED_W = OPACITY_W > 32 ? OPACITY_W : 32;

  wire [COMPARED_W-1:0] held = COMPARED_W'(opacity) << OF_OPACITY;
  wire [COMPARED_W-1:0] limit = (COMPARED_W'(weight) * COMPARED_W'(machine_pkg::FRAGMENT_OPAQUE_LIMIT)) << OF_LIMIT;
  wire of_sums = weight >= coverage_threshold && held >= limit;
  wire of_light = SHADED_W'(opacity) >= SHADED_W'(machine_pkg::FRAGMENT_OPAQUE_SHADED);
  assign opaque = shaded ? of_light : of_sums;
endmodule

`default_nettype wire
