// Windows_late: blends a late contribution over the front of a closed slot or under its back. RTL
// implementation of `add_late` in units/fragment/window.rs.
//
//   weight, had, threshold ->[ missing amount of its part ]-> numerator, denominator ->( quotient )-> share
//   share, light, colours ->[ over the front: share and 1 - share | under the back: share of 1 - opacity ]-> the slot's next words
//
// Losses: each word of the slot is rounded once, and so is the share that is visible under the
// back.
`timescale 1ns / 1ps
`default_nettype none

module windows_late #(
    parameter int QUOTIENT_W = 2 // bits of numerators and denominators
) (
    input wire back,                                                   // under the back, not over the front
    input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] weight,               // of the contribution
    input wire [machine_pkg::SPLAT_OPACITY_W-1:0] alpha,               // of its splat
    input wire [3*machine_pkg::SPLAT_RGB_W-1:0] light,                 // of its splat, blue in the low bits
    input wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] threshold,     // the weight that covers a pixel
    input wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] had,           // the weight of its part of the slot
    input wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] colours,     // of the slot
    input wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] opacity,      // of the slot
    input wire [2*machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] through, // transmittances behind its front and before its back
    output wire [QUOTIENT_W-1:0] numerator,                            // added amount
    output wire [QUOTIENT_W-1:0] denominator,                          // missing amount of the part
    input wire [machine_pkg::FRAGMENT_WINDOW_PART_W-1:0] share,        // quotient
    output wire [machine_pkg::FRAGMENT_WEIGHT_SUM_W-1:0] next_weight,
    output wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] next_colours,
    output wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] next_opacity,
    output wire [2*machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] next_through
);
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int RGB_F = machine_pkg::SPLAT_RGB_F;
  localparam int ALPHA_F = machine_pkg::SPLAT_OPACITY_F;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int THROUGH_W = machine_pkg::FRAGMENT_WINDOW_THROUGH_W;
  localparam int PART_W = machine_pkg::FRAGMENT_WINDOW_PART_W;
  localparam int PART_F = machine_pkg::FRAGMENT_WINDOW_PART_F;
  localparam [PART_W-1:0] ONE = PART_W'(1) << PART_F;

  // The weight alone, and with the weight of the part.
  wire [WEIGHT_W-1:0] weighs;
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(machine_pkg::FRAGMENT_WEIGHT_SUM_F),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WEIGHT_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) alone (
      .sum({WEIGHT_W{1'b0}}),
      .weight(weight),
      .attribute(1'b1),
      .next(weighs)
  );
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(machine_pkg::FRAGMENT_WEIGHT_SUM_F),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WEIGHT_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) together (
      .sum(had),
      .weight(weight),
      .attribute(1'b1),
      .next(next_weight)
  );

  // The added amount is opacity times weight, up to the weight that the part lacks; the missing
  // amount is the same for an opaque splat.
  wire [WEIGHT_W-1:0] covers = had < threshold ? had : threshold;
  wire [WEIGHT_W-1:0] lacks = threshold - covers;
  wire [WEIGHT_W-1:0] adds = weighs < lacks ? weighs : lacks;
  assign numerator = QUOTIENT_W'(alpha) * QUOTIENT_W'(adds);
  wire [QUOTIENT_W-1:0] whole = QUOTIENT_W'(threshold) << ALPHA_F;
  wire [QUOTIENT_W-1:0] taken = QUOTIENT_W'(alpha) * QUOTIENT_W'(covers);
  assign denominator = whole > taken ? whole - taken : '0;

  wire [4*LIGHT_W-1:0] lit;
  fragment_read read (.colours(colours), .opacity(opacity), .lit(lit));
  wire [LIGHT_W-1:0] lit_opacity = lit[LIGHT_W-1:0];
  wire [PART_W-1:0] kept = ONE - share;

  // Under the back, it is attenuated by the transmittance of the slot.
  localparam [LIGHT_W-1:0] LIGHT_ONE = LIGHT_W'(1) << LIGHT_F;
  wire [LIGHT_W-1:0] clear = lit_opacity > LIGHT_ONE ? '0 : LIGHT_ONE - lit_opacity;
  wire signed [PART_W+LIGHT_W:0] under = $signed({1'b0, share}) * $signed((PART_W + LIGHT_W + 1)'(clear));
  wire [PART_W-1:0] fitted, seen;
  fit #(
      .IN_W(PART_W + LIGHT_W + 1),
      .PLACES(LIGHT_F),
      .W(PART_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_PART_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_PART_WRAP)
  ) fit_under (
      .exact(under),
      .word(fitted)
  );
  assign seen = fitted > ONE ? ONE : fitted;

  // Colours: all terms with the fraction bits of the finest one.
  localparam int OVER_F = RGB_F > LIGHT_F ? RGB_F : LIGHT_F;
  localparam int UNDER_F = RGB_F + PART_F > LIGHT_F ? RGB_F + PART_F : LIGHT_F;
  localparam int OVER_W = PART_W + (RGB_W > LIGHT_W ? RGB_W : LIGHT_W) + 2 + OVER_F;
  localparam int UNDER_W = PART_W + RGB_W + LIGHT_W + 2 + UNDER_F;
  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    wire [RGB_W-1:0] own = light[channel*RGB_W+:RGB_W];
    wire [LIGHT_W-1:0] held = lit[(channel+1)*LIGHT_W+:LIGHT_W];
    wire signed [OVER_W-1:0] exact_over = ((OVER_W'($signed({1'b0, own})) * OVER_W'($signed({1'b0, share}))) <<< (OVER_F - RGB_F))
        + ((OVER_W'($signed({1'b0, held})) * OVER_W'($signed({1'b0, kept}))) <<< (OVER_F - LIGHT_F));
    wire signed [UNDER_W-1:0] exact_under = ((UNDER_W'($signed({1'b0, own})) * UNDER_W'($signed({1'b0, seen}))) <<< (UNDER_F - RGB_F - PART_F))
        + (UNDER_W'($signed({1'b0, held})) <<< (UNDER_F - LIGHT_F));
    wire [COLOUR_W-1:0] word_over, word_under;
    fit #(
        .IN_W(OVER_W),
        .PLACES(PART_F + OVER_F - machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) fit_over (
        .exact(exact_over),
        .word(word_over)
    );
    fit #(
        .IN_W(UNDER_W),
        .PLACES(UNDER_F - machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) fit_under_colour (
        .exact(exact_under),
        .word(word_under)
    );
    assign next_colours[channel*COLOUR_W+:COLOUR_W] = back ? word_under : word_over;
  end

  localparam int SUM_F = PART_F > LIGHT_F ? PART_F : LIGHT_F;
  localparam int ALL_W = PART_W + LIGHT_W + 2 + SUM_F;
  wire signed [ALL_W-1:0] opacity_over =
      (ALL_W'($signed({1'b0, share})) <<< LIGHT_F) + ALL_W'($signed({1'b0, lit_opacity})) * ALL_W'($signed({1'b0, kept}));
  wire signed [ALL_W-1:0] opacity_under =
      (ALL_W'($signed({1'b0, seen})) <<< (SUM_F - PART_F)) + (ALL_W'($signed({1'b0, lit_opacity})) <<< (SUM_F - LIGHT_F));
  wire [OPACITY_W-1:0] word_over, word_under;
  fit #(
      .IN_W(ALL_W),
      .PLACES(PART_F + LIGHT_F - machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) fit_opacity_over (
      .exact(opacity_over),
      .word(word_over)
  );
  fit #(
      .IN_W(ALL_W),
      .PLACES(SUM_F - machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) fit_opacity_under (
      .exact(opacity_under),
      .word(word_under)
  );
  assign next_opacity = back ? word_under : word_over;

  // A contribution to the front dims everything behind it.
  for (genvar side = 0; side < 2; side++) begin : g_through
    wire [THROUGH_W-1:0] had_through = through[side*THROUGH_W+:THROUGH_W];
    wire [THROUGH_W-1:0] dimmed;
    wire signed [THROUGH_W+PART_W+1:0] exact = $signed({1'b0, had_through}) * $signed({1'b0, kept});
    fit #(
        .IN_W(THROUGH_W + PART_W + 2),
        .PLACES(PART_F),
        .W(THROUGH_W),
        .S(0),
        .ROUND(machine_pkg::FRAGMENT_WINDOW_THROUGH_ROUND),
        .WRAP(machine_pkg::FRAGMENT_WINDOW_THROUGH_WRAP)
    ) fit_through (
        .exact(exact),
        .word(dimmed)
    );
    assign next_through[side*THROUGH_W+:THROUGH_W] = back ? had_through : dimmed;
  end
endmodule

`default_nettype wire
