// Fragment_lit: the light of a fragment in the format of a slot. RTL implementation of `light` and
// `shaded` in units/fragment.rs.
//
//   light ->[ fit ]-> sums -+->[ fit ]-> lit
//   slot, if shaded --------^
//
// Losses: a light is truncated to the word of the sum that stores it, and a slot's content to the
// word of a light.
`timescale 1ns / 1ps
`default_nettype none

module fragment_lit (
    // A light has only the colour and the opacity of a request's fields.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAGMENT_REQUEST_WEIGHT_LSB+machine_pkg::FRAGMENT_REQUEST_WEIGHT_W-1:0] slot, // content of a slot
    // verilator lint_on UNUSEDSIGNAL
    input wire shaded,                                            // whether it is shaded
    input wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] light,        // response of shade, if it is not
    output wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] lit    // colour times opacity, and opacity
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int COLOUR_F = machine_pkg::FRAGMENT_COLOUR_SUM_F;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int OPACITY_F = machine_pkg::FRAGMENT_OPACITY_SUM_F;

  wire [3*COLOUR_W-1:0] colours;
  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    wire [COLOUR_W-1:0] stored;
    assign colours[channel*COLOUR_W+:COLOUR_W] =
        shaded ? slot[machine_pkg::FRAGMENT_REQUEST_COLOUR_B_LSB+channel*COLOUR_W+:COLOUR_W] : stored;
    fit #(
        .IN_W(LIGHT_W + 1),
        .PLACES(LIGHT_F - COLOUR_F),
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) fit_store (
        .exact($signed({1'b0, light[machine_pkg::FRAGMENT_ANSWER_COLOUR_B_LSB+channel*LIGHT_W+:LIGHT_W]})),
        .word(stored)
    );
  end

  wire [OPACITY_W-1:0] stored;
  wire [OPACITY_W-1:0] sum = shaded ? slot[machine_pkg::FRAGMENT_REQUEST_OPACITY_LSB+:OPACITY_W] : stored;
  fit #(
      .IN_W(LIGHT_W + 1),
      .PLACES(LIGHT_F - OPACITY_F),
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) fit_store (
      .exact($signed({1'b0, light[machine_pkg::FRAGMENT_ANSWER_OPACITY_LSB+:LIGHT_W]})),
      .word(stored)
  );

  fragment_read read (.colours(colours), .opacity(sum), .lit(lit));
endmodule

`default_nettype wire
