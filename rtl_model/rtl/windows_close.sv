// Windows_close: closes a slot, shaded once. RTL implementation of `closed` in
// units/fragment/window.rs.
//
//   light ->[ fit ]-> colours, opacity          light ->( 1 - opacity )-> transmittance behind it
//
// Its front and its back both are the whole slot. A slot that is already closed is unchanged.
//
// Losses: a light is truncated to the word of a slot, and so is the transmittance behind it.
`timescale 1ns / 1ps
`default_nettype none

module windows_close #(
    parameter int SLOT_W = 2, // bits of a slot: closed, nearest, farthest depth, material, weight, colours, opacity
    parameter int REST_W = 1  // and of the fields that differ between open and closed slots
) (
    input wire [SLOT_W-1:0] slot,                           // the slot
    input wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] light,  // response of shade
    output wire [SLOT_W-1:0] shut                           // the same, closed
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int DEPTH_W = machine_pkg::FRAGMENT_DEPTH_W;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int THROUGH_W = machine_pkg::FRAGMENT_WINDOW_THROUGH_W;
  localparam [THROUGH_W-1:0] ONE = THROUGH_W'(1) << machine_pkg::FRAGMENT_WINDOW_THROUGH_F;
  localparam int WEIGHT = REST_W + OPACITY_W + 3 * COLOUR_W;

  wire [3*COLOUR_W-1:0] colours;
  wire [OPACITY_W-1:0] opacity;
  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    fit #(
        .IN_W(LIGHT_W + 1),
        .PLACES(LIGHT_F - machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) fit_colour (
        .exact($signed({1'b0, light[(channel+1)*LIGHT_W+:LIGHT_W]})),
        .word(colours[channel*COLOUR_W+:COLOUR_W])
    );
  end
  fit #(
      .IN_W(LIGHT_W + 1),
      .PLACES(LIGHT_F - machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) fit_opacity (
      .exact($signed({1'b0, light[LIGHT_W-1:0]})),
      .word(opacity)
  );
  wire [THROUGH_W-1:0] through;
  windows_rest rest (.opacity(light[LIGHT_W-1:0]), .through(through));

  wire [DEPTH_W-1:0] near = slot[SLOT_W-2-:DEPTH_W];
  wire [DEPTH_W-1:0] far = slot[SLOT_W-2-DEPTH_W-:DEPTH_W];
  wire [WEIGHT_W-1:0] weight = slot[WEIGHT+:WEIGHT_W];
  wire [SLOT_W-1:0] closed = {1'b1, slot[SLOT_W-2:WEIGHT], colours, opacity, REST_W'({far, near, weight, through, ONE})};
  assign shut = slot[SLOT_W-1] ? slot : closed;
endmodule

`default_nettype wire
