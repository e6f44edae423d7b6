// Fit shifted: a barrel shifter before a fit, for a result whose binary point depends on the data.
// RTL implementation of num/fit.rs, Fit::one_shifted.
//
//   exact ->[ << | >> ]->( fit )-> word
//
// Loss: as in fit.
`timescale 1ns / 1ps
`default_nettype none

module fit_shifted #(
    parameter int IN_W = 1,   // bits of the exact result
    parameter int PLACES = 0, // the constant part of its fraction bits, less those of the word
    parameter int MORE_W = 8, // bits of the additional places given by the data
    parameter int W = 1,      // bits of the word
    parameter int S = 0,      // 1: the word is signed
    parameter int ROUND = 1,  // 0 truncate, 1 nearest (ties up), 2 nearest-even
    parameter int WRAP = 0,   // 0 saturate, 1 wrap
    parameter int P = 0,      // significant bits of a floating-point word; 0 in fixed point
    parameter int FLUSH = 0   // 1: its subnormal words are flushed to zero
) (
    input wire signed [IN_W-1:0] exact,  // the exact result
    input wire signed [MORE_W-1:0] more, // its additional fraction bits
    output wire [W-1:0] word             // the word
);
  localparam int LEAST = PLACES - 2 ** (MORE_W - 1);
  localparam int MOST = PLACES + 2 ** (MORE_W - 1) - 1;
  // Larger shifts do not change the word: to the left only a limit remains, to the right only the
  // sign.
  localparam int LEFT = LEAST >= 0 ? 0 : -LEAST < W ? -LEAST : W;
  localparam int RIGHT = MOST <= 0 ? 0 : MOST < IN_W ? MOST : IN_W;
  // Bits for the rounding of the fit: one, and a sticky bit for ties, and for the magnitude of a
  // floating-point word.
  localparam int GUARD = ROUND == 0 && P == 0 ? 0 : 1;
  localparam int STICKY = ROUND == 2 || P != 0 ? 1 : 0;
  localparam int BARREL_W = IN_W + LEFT + GUARD;
  // The shifter only shifts right, starting from the largest left shift.
  localparam int FROM = PLACES + LEFT;
  localparam int SUM_W = 1 + $clog2((FROM < 0 ? -FROM : FROM) + 2 ** (MORE_W - 1) + LEFT + RIGHT + 1);
  localparam int AMOUNT_W = $clog2(LEFT + RIGHT + 2);

  wire signed [SUM_W-1:0] sum = SUM_W'(more) + SUM_W'(FROM);
  wire [AMOUNT_W-1:0] amount = sum < SUM_W'(0) ? '0 : sum > SUM_W'(LEFT + RIGHT) ? AMOUNT_W'(LEFT + RIGHT) : AMOUNT_W'(sum);

  wire signed [BARREL_W-1:0] start = BARREL_W'(exact) <<< (LEFT + GUARD);
  wire signed [BARREL_W-1:0] shifted = start >>> amount;
  wire signed [BARREL_W+STICKY-1:0] rest;
  if (STICKY != 0) begin : g_sticky
    assign rest = {shifted, (shifted <<< amount) != start};
  end else begin : g_plain
    assign rest = shifted;
  end

  if (P == 0) begin : g_fixed
    fit #(.IN_W(BARREL_W + STICKY), .PLACES(GUARD + STICKY), .W(W), .S(S), .ROUND(ROUND), .WRAP(WRAP)) last (.exact(rest), .word(word));
  end else begin : g_float
    fit_float #(.IN_W(BARREL_W + STICKY), .PLACES(GUARD + STICKY), .W(W), .S(S), .P(P), .ROUND(ROUND), .FLUSH(FLUSH)) last (.exact(rest), .word(word));
  end
endmodule

`default_nettype wire
