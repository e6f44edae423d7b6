// Windows_splat: a contribution in the format of an inside blend into a closed slot. RTL
// implementation of `splat_inside` in units/fragment/window.rs.
//
//   weight * density ->[ fit ]-> index ->[ table ]-> hidden ->[ fit ]-> opacity, at most 1
//   light ------------------------------------------------------------>(x)->[ fit ]-> colours
//
// Losses: the index is truncated to the table's argument; the value between two of its entries and
// the products are rounded.
`timescale 1ns / 1ps
`default_nettype none

module windows_splat #(
    parameter ROMS = "rom/" // folder of the tables, with its slash
) (
    input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] weight,             // of the contribution
    input wire [machine_pkg::FRAGMENT_WINDOW_DENSITY_W-1:0] density, // density of its splat
    input wire [3*machine_pkg::SPLAT_RGB_W-1:0] light,               // of its splat, blue in the low bits
    output wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] lit       // colour times opacity, and opacity
);
  localparam int GAUSS_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int DENSITY_W = machine_pkg::FRAGMENT_WINDOW_DENSITY_W;
  localparam int INDEX_W = machine_pkg::FRAGMENT_WINDOW_EXPONENT_W;
  localparam int HIDDEN_W = machine_pkg::FRAGMENT_WINDOW_HIDDEN_W;
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam [LIGHT_W-1:0] ONE = LIGHT_W'(1) << LIGHT_F;

  wire signed [GAUSS_W+DENSITY_W+1:0] product = $signed({1'b0, weight}) * $signed({1'b0, density});
  wire [INDEX_W-1:0] index;
  fit #(
      .IN_W(GAUSS_W + DENSITY_W + 2),
      .PLACES(machine_pkg::GAUSS_WEIGHT_F + machine_pkg::FRAGMENT_WINDOW_DENSITY_F - machine_pkg::FRAGMENT_WINDOW_EXPONENT_F),
      .W(INDEX_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_EXPONENT_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_EXPONENT_WRAP)
  ) fit_index (
      .exact(product),
      .word(index)
  );
  wire [HIDDEN_W-1:0] hidden;
  lookup #(
      .ARGUMENT_W(INDEX_W),
      .TABLE_BITS(machine_pkg::FRAGMENT_WINDOW_HIDDEN_TABLE_BITS),
      .LINEAR(machine_pkg::FRAGMENT_WINDOW_HIDDEN_TABLE_LINEAR),
      .W(HIDDEN_W),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_HIDDEN_ROUND),
      .ROM({ROMS, "fragment.window.hidden.hex"})
  ) hides (
      .argument(index),
      .word(hidden)
  );
  wire [LIGHT_W-1:0] fitted;
  fit #(
      .IN_W(HIDDEN_W + 1),
      .PLACES(machine_pkg::FRAGMENT_WINDOW_HIDDEN_F - LIGHT_F),
      .W(LIGHT_W),
      .S(machine_pkg::SHADE_PREMULTIPLIED_S),
      .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
      .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
  ) fit_opacity (
      .exact($signed({1'b0, hidden})),
      .word(fitted)
  );
  wire [LIGHT_W-1:0] opacity = fitted > ONE ? ONE : fitted;
  assign lit[LIGHT_W-1:0] = opacity;
  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    wire signed [RGB_W+LIGHT_W+1:0] exact = $signed({1'b0, light[channel*RGB_W+:RGB_W]}) * $signed({1'b0, opacity});
    fit #(
        .IN_W(RGB_W + LIGHT_W + 2),
        .PLACES(machine_pkg::SPLAT_RGB_F),
        .W(LIGHT_W),
        .S(machine_pkg::SHADE_PREMULTIPLIED_S),
        .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
        .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
    ) fit_colour (
        .exact(exact),
        .word(lit[(channel+1)*LIGHT_W+:LIGHT_W])
    );
  end
endmodule

`default_nettype wire
