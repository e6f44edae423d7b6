// Sheets_close: the light of a finished sheet. RTL implementation of `close` in
// units/fragment/sheets.rs.
//
//   weight -+->[ fit ]-> index ->[ table ]-> ratio -+
//           +-------------------------------------->(x)->[ fit ]-> opacity, at most 1
//   colours --------------------------------------->(x)->[ fit ]-> colour times opacity
//
// Losses: the index is truncated to the table's argument; the ratio between two of its values and
// the products are rounded. Without a ratio the sums are quantised directly.
`timescale 1ns / 1ps
`default_nettype none

module sheets_close #(
    parameter ROMS = "rom/" // folder of the tables, with its slash
) (
    input wire has_ratio,                                          // the table is used
    input wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] weight,    // the sheet's weight
    input wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] colours, // and its colours
    output wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] light   // colour times opacity, and opacity
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int WEIGHT_F = machine_pkg::FRAGMENT_WEIGHT_SUM_F;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int COLOUR_F = machine_pkg::FRAGMENT_COLOUR_SUM_F;
  localparam int INDEX_W = machine_pkg::FRAGMENT_DEPTH_INDEX_W;
  localparam int RATIO_W = machine_pkg::FRAGMENT_RATIO_W;
  localparam int RATIO_F = machine_pkg::FRAGMENT_RATIO_F;
  localparam [LIGHT_W-1:0] ONE = LIGHT_W'(1) << LIGHT_F;

  wire [INDEX_W-1:0] index;
  fit #(
      .IN_W(WEIGHT_W + 1),
      .PLACES(WEIGHT_F - machine_pkg::FRAGMENT_DEPTH_INDEX_F),
      .W(INDEX_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_DEPTH_INDEX_ROUND),
      .WRAP(machine_pkg::FRAGMENT_DEPTH_INDEX_WRAP)
  ) fit_index (
      .exact($signed({1'b0, weight})),
      .word(index)
  );
  wire [RATIO_W-1:0] ratio;
  lookup #(
      .ARGUMENT_W(INDEX_W),
      .TABLE_BITS(machine_pkg::FRAGMENT_RATIO_TABLE_BITS),
      .LINEAR(machine_pkg::FRAGMENT_RATIO_TABLE_LINEAR),
      .W(RATIO_W),
      .ROUND(machine_pkg::FRAGMENT_RATIO_ROUND),
      .ROM({ROMS, "fragment.ratio.hex"})
  ) ratios (
      .argument(index),
      .word(ratio)
  );

  wire signed [WEIGHT_W+RATIO_W:0] scaled = $signed({1'b0, weight}) * $signed({1'b0, ratio});
  wire [LIGHT_W-1:0] closed, plain;
  fit #(
      .IN_W(WEIGHT_W + RATIO_W + 1),
      .PLACES(WEIGHT_F + RATIO_F - LIGHT_F),
      .W(LIGHT_W),
      .S(machine_pkg::SHADE_PREMULTIPLIED_S),
      .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
      .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
  ) fit_closed (
      .exact(scaled),
      .word(closed)
  );
  fit #(
      .IN_W(WEIGHT_W + 1),
      .PLACES(WEIGHT_F - LIGHT_F),
      .W(LIGHT_W),
      .S(machine_pkg::SHADE_PREMULTIPLIED_S),
      .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
      .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
  ) fit_plain (
      .exact($signed({1'b0, weight})),
      .word(plain)
  );
  wire [LIGHT_W-1:0] opacity = has_ratio ? closed : plain;
  assign light[LIGHT_W-1:0] = opacity > ONE ? ONE : opacity;

  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    wire [COLOUR_W-1:0] sum = colours[channel*COLOUR_W+:COLOUR_W];
    wire signed [COLOUR_W+RATIO_W:0] scaled_colour = $signed({1'b0, sum}) * $signed({1'b0, ratio});
    wire [LIGHT_W-1:0] closed_colour, plain_colour;
    fit #(
        .IN_W(COLOUR_W + RATIO_W + 1),
        .PLACES(COLOUR_F + RATIO_F - LIGHT_F),
        .W(LIGHT_W),
        .S(machine_pkg::SHADE_PREMULTIPLIED_S),
        .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
        .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
    ) fit_closed_colour (
        .exact(scaled_colour),
        .word(closed_colour)
    );
    fit #(
        .IN_W(COLOUR_W + 1),
        .PLACES(COLOUR_F - LIGHT_F),
        .W(LIGHT_W),
        .S(machine_pkg::SHADE_PREMULTIPLIED_S),
        .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND),
        .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP)
    ) fit_plain_colour (
        .exact($signed({1'b0, sum})),
        .word(plain_colour)
    );
    assign light[(channel+1)*LIGHT_W+:LIGHT_W] = has_ratio ? closed_colour : plain_colour;
  end
endmodule

`default_nettype wire
