// Windows_quotient: a quotient of words that are not negative, at most 1. RTL implementation of
// `quotient` in units/fragment/window.rs.
//
//   denominator ->( reciprocal )-+-> inverse ----------------v
//                                +-> exponent                (x)->[ fit ]-> part, at most 1
//   numerator ---------->[ fit, shifted by it ]-> share -----^
//
// Losses: the numerator is rounded to a share when the exponent is known, and the quotient to a
// part.
`timescale 1ns / 1ps
`default_nettype none

module windows_quotient #(
    parameter int W = 2,                                        // bits of both
    parameter int PLACES_W = 9,                                 // bits of the places
    parameter ROM = "reciprocal.hex"                            // the reciprocal's table
) (
    input wire [W-1:0] numerator,                               // above
    input wire [W-1:0] denominator,                             // below; where it is 0 the quotient is 1, or 0 if both are
    input wire signed [PLACES_W-1:0] places,                    // fraction bits of the first, less the second's, less a share's
    output wire [machine_pkg::FRAGMENT_WINDOW_PART_W-1:0] part  // the quotient
);
  localparam int SHARE_W = machine_pkg::FRAGMENT_WINDOW_SHARE_W;
  localparam int PART_W = machine_pkg::FRAGMENT_WINDOW_PART_W;
  localparam int BITS = machine_pkg::FRAGMENT_WINDOW_RECIPROCAL_BITS;
  localparam [PART_W-1:0] ONE = PART_W'(1) << machine_pkg::FRAGMENT_WINDOW_PART_F;

  wire [BITS:0] inverse;
  wire signed [7:0] exponent;
  reciprocal #(
      .IN_W(W),
      .IN_F(0),
      .BITS(BITS),
      .TABLE_BITS(machine_pkg::FRAGMENT_WINDOW_RECIPROCAL_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::FRAGMENT_WINDOW_RECIPROCAL_NEWTON_STEPS),
      .ROM(ROM)
  ) inverter (
      .x(denominator == '0 ? W'(1) : denominator),
      .mantissa(inverse),
      .exponent(exponent)
  );
  wire [SHARE_W-1:0] share;
  fit_shifted #(
      .IN_W(W + 1),
      .PLACES(0),
      .MORE_W(PLACES_W),
      .W(SHARE_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_SHARE_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_SHARE_WRAP)
  ) fit_share (
      .exact($signed({1'b0, numerator})),
      .more(places - PLACES_W'(exponent)),
      .word(share)
  );
  wire signed [SHARE_W+BITS+1:0] product = $signed({1'b0, share}) * $signed({1'b0, inverse});
  wire [PART_W-1:0] fitted;
  fit #(
      .IN_W(SHARE_W + BITS + 2),
      .PLACES(machine_pkg::FRAGMENT_WINDOW_SHARE_F + BITS - machine_pkg::FRAGMENT_WINDOW_PART_F),
      .W(PART_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_PART_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_PART_WRAP)
  ) fit_part (
      .exact(product),
      .word(fitted)
  );
  assign part = numerator == '0 ? '0 : denominator == '0 || fitted > ONE ? ONE : fitted;
endmodule

`default_nettype wire
