// Fragment_read: the light in a slot, in the format of a blend. RTL implementation of `shaded` in
// units/fragment.rs.
//
//   colours, opacity ->[ fit ]-> lit
//
// Loss: a slot's content is truncated to the word of a light.
`timescale 1ns / 1ps
`default_nettype none

module fragment_read #(
    parameter int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W,   // bits of a colour
    parameter int COLOUR_F = machine_pkg::FRAGMENT_COLOUR_SUM_F,   // its fraction bits
    parameter int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W, // bits of the opacity
    parameter int OPACITY_F = machine_pkg::FRAGMENT_OPACITY_SUM_F  // its fraction bits
) (
    input wire [3*COLOUR_W-1:0] colours,                       // in the words of a slot
    input wire [OPACITY_W-1:0] opacity,                        // likewise
    output wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] lit // colour times opacity, and opacity
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;

  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    fit #(
        .IN_W(COLOUR_W + 1),
        .PLACES(COLOUR_F - LIGHT_F),
        .W(LIGHT_W),
        .S(machine_pkg::SHADE_PREMULTIPLIED_S),
        .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
        .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
    ) fit_colour (
        .exact($signed({1'b0, colours[channel*COLOUR_W+:COLOUR_W]})),
        .word(lit[(channel+1)*LIGHT_W+:LIGHT_W])
    );
  end
  fit #(
      .IN_W(OPACITY_W + 1),
      .PLACES(OPACITY_F - LIGHT_F),
      .W(LIGHT_W),
      .S(machine_pkg::SHADE_PREMULTIPLIED_S),
      .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
      .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
  ) fit_opacity (
      .exact($signed({1'b0, opacity})),
      .word(lit[LIGHT_W-1:0])
  );
endmodule

`default_nettype wire
