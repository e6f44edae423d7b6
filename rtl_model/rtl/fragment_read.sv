// Fragment_read: the light in a slot, in the format of a blend. RTL implementation of `shaded` in
// units/fragment.rs.
//
//   colours, opacity ->[ fit ]-> lit
//
// Loss: a slot's content is truncated to the word of a light.
`timescale 1ns / 1ps
`default_nettype none

module fragment_read (
    input wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] colours, // in the words of sums
    input wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] opacity,  // likewise
    output wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] lit     // colour times opacity, and opacity
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;

  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    fit #(
        .IN_W(COLOUR_W + 1),
        .PLACES(machine_pkg::FRAGMENT_COLOUR_SUM_F - LIGHT_F),
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
      .PLACES(machine_pkg::FRAGMENT_OPACITY_SUM_F - LIGHT_F),
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
