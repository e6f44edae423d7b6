// Windows_inside: blends a light between the front and the back of a closed slot, which is treated
// as one colour. RTL implementation of `put_inside` in units/fragment/window.rs.
//
//   x's opacity * (seen - through), opacity ->( quotient )-> lost
//   colours * (1 - lost) + x's colours * seen -> the slot's next colours
//
// Losses: each word of the slot is rounded once.
`timescale 1ns / 1ps
`default_nettype none

module windows_inside #(
    parameter int QUOTIENT_W = 2 // bits of numerators and denominators
) (
    input wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] colours,          // of the slot
    input wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] opacity,           // of the slot
    input wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] behind_front,   // transmittance behind its front
    input wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] before_back,    // and before its back
    input wire nearer_back,                                                 // x lies nearer to the back
    input wire [4*machine_pkg::SHADE_PREMULTIPLIED_W-1:0] x,                // the light
    output wire [QUOTIENT_W-1:0] numerator,                                 // what x hides of the slot
    output wire [QUOTIENT_W-1:0] denominator,                               // the slot's opacity
    input wire [machine_pkg::FRAGMENT_WINDOW_PART_W-1:0] lost,              // quotient
    output wire [3*machine_pkg::FRAGMENT_COLOUR_SUM_W-1:0] next_colours,
    output wire [machine_pkg::FRAGMENT_OPACITY_SUM_W-1:0] next_opacity,
    output wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] next_before_back
);
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int THROUGH_W = machine_pkg::FRAGMENT_WINDOW_THROUGH_W;
  localparam int THROUGH_F = machine_pkg::FRAGMENT_WINDOW_THROUGH_F;
  localparam int PART_W = machine_pkg::FRAGMENT_WINDOW_PART_W;
  localparam int PART_F = machine_pkg::FRAGMENT_WINDOW_PART_F;
  localparam [PART_W-1:0] ONE = PART_W'(1) << PART_F;
  localparam [LIGHT_W-1:0] LIGHT_ONE = LIGHT_W'(1) << LIGHT_F;

  wire [4*LIGHT_W-1:0] lit;
  fragment_read read (.colours(colours), .opacity(opacity), .lit(lit));
  wire [LIGHT_W-1:0] lit_opacity = lit[LIGHT_W-1:0];
  wire [LIGHT_W-1:0] x_opacity = x[LIGHT_W-1:0];

  // The visible part of x: the transmittance of the front, or, nearer to the back, that before the
  // back.
  wire [THROUGH_W-1:0] through;
  windows_rest rest (.opacity(lit_opacity), .through(through));
  wire [THROUGH_W-1:0] at_front = behind_front > through ? behind_front : through;
  wire [THROUGH_W-1:0] at_back = before_back > through ? before_back : through;
  wire [THROUGH_W-1:0] seen = nearer_back && at_back < at_front ? at_back : at_front;
  wire [THROUGH_W-1:0] beyond = seen - through;
  assign numerator = QUOTIENT_W'(x_opacity) * QUOTIENT_W'(beyond);
  assign denominator = QUOTIENT_W'(lit_opacity);

  localparam int FINE_F = PART_F > THROUGH_F ? PART_F : THROUGH_F;
  localparam int EXACT_W = LIGHT_W + PART_W + THROUGH_W + 2 + FINE_F;
  wire [PART_W-1:0] kept = ONE - lost;
  for (genvar channel = 0; channel < 3; channel++) begin : g_colour
    wire [LIGHT_W-1:0] held = lit[(channel+1)*LIGHT_W+:LIGHT_W];
    wire [LIGHT_W-1:0] own = x[(channel+1)*LIGHT_W+:LIGHT_W];
    wire signed [EXACT_W-1:0] exact = ((EXACT_W'($signed({1'b0, held})) * EXACT_W'($signed({1'b0, kept}))) <<< (FINE_F - PART_F))
        + ((EXACT_W'($signed({1'b0, own})) * EXACT_W'($signed({1'b0, seen}))) <<< (FINE_F - THROUGH_F));
    fit #(
        .IN_W(EXACT_W),
        .PLACES(LIGHT_F + FINE_F - machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) fit_colour (
        .exact(exact),
        .word(next_colours[channel*COLOUR_W+:COLOUR_W])
    );
  end

  // The transmittance of an opacity above 1 is 0.
  wire [LIGHT_W-1:0] behind = x_opacity > LIGHT_ONE ? '0 : LIGHT_ONE - x_opacity;
  wire [LIGHT_W-1:0] clear = lit_opacity > LIGHT_ONE ? '0 : LIGHT_ONE - lit_opacity;
  localparam int ALL_W = 2 * LIGHT_W + 2;
  wire signed [ALL_W-1:0] hid =
      $signed(ALL_W'(1) << (2 * LIGHT_F)) - ALL_W'($signed({1'b0, clear})) * ALL_W'($signed({1'b0, behind}));
  fit #(
      .IN_W(ALL_W),
      .PLACES(2 * LIGHT_F - machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) fit_opacity (
      .exact(hid),
      .word(next_opacity)
  );
  windows_dimmed dimmed (.through(before_back), .clear(behind), .next(next_before_back));
endmodule

`default_nettype wire
