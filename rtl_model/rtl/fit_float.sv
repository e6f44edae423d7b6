// Fit float: quantises an exact result to a floating-point word, which keeps its most significant
// bits. RTL implementation of num/fit.rs, Fit::one, for num/float.rs.
//
//   exact ->( magnitude )->[ << left ]->( leading one )->( + round )->[ saturate ]-> word
//
// Loss: bits below the significant ones, or below the format's least place, are rounded; subnormal
// words can be flushed to zero; outside its range the word saturates.
`timescale 1ns / 1ps
`default_nettype none

module fit_float #(
    parameter int IN_W = 1,   // bits of the exact result
    parameter int PLACES = 0, // its fraction bits less those of the word
    parameter int W = 4,      // bits of the word, from its sign to its least place
    parameter int S = 0,      // 1: the word is signed
    parameter int P = 2,      // its significant bits
    parameter int ROUND = 2,  // 0 towards zero, 1 nearest (ties away from zero), 2 nearest-even
    parameter int FLUSH = 0   // 1: subnormal words are flushed to zero
) (
    input wire signed [IN_W-1:0] exact, // the exact result
    output wire [W-1:0] word            // the word
);
  // Larger shifts do not change the word: to the left only a limit remains, to the right nothing.
  localparam int LEFT = PLACES >= 0 ? 0 : -PLACES < W ? -PLACES : W;
  localparam int RIGHT = PLACES <= 0 ? 0 : PLACES < IN_W + 1 ? PLACES : IN_W + 1;
  localparam int MAG_W = IN_W + LEFT + 1;
  localparam int DROPPED_W = $clog2(MAG_W + 1);
  // Rounding up may need one more bit.
  localparam int OUT_W = MAG_W + 1 - RIGHT > W + 1 ? MAG_W + 1 - RIGHT : W + 1;
  // The greatest word; a code is left for NaN where the exponents and the code of subnormal numbers
  // fill the exponent field.
  localparam int M = W - S;
  localparam int EXPONENTS = M - P + 1;
  localparam int RESERVED = ((EXPONENTS + 1) & EXPONENTS) == 0 ? 1 : 0;
  localparam [OUT_W-1:0] MAX = ((OUT_W'(1) << P) - OUT_W'(1) - OUT_W'(RESERVED)) << (M - P);

  wire negative = exact[IN_W-1];
  wire [IN_W-1:0] bare = negative ? -exact : exact;
  wire [MAG_W-1:0] magnitude = MAG_W'(bare) << LEFT;

  logic [DROPPED_W-1:0] dropped;
  always_comb begin
    dropped = DROPPED_W'(RIGHT);
    for (int place = RIGHT + P; place < MAG_W; place++) begin
      if (magnitude[place]) dropped = DROPPED_W'(place - P + 1);
    end
  end

  wire [P-1:0] kept = P'(magnitude >> dropped);
  wire up;
  if (ROUND == 0) begin : g_towards_zero
    assign up = 1'b0;
  end else begin : g_nearest
    wire [MAG_W-1:0] rest = magnitude - (MAG_W'(kept) << dropped);
    wire [MAG_W-1:0] half = (MAG_W'(1) << dropped) >> 1;
    // A tie is rounded up, or to an even number of places.
    assign up = |dropped && (rest > half || (rest == half && (ROUND == 1 || kept[0])));
  end
  wire [OUT_W-1:0] rounded = (OUT_W'(kept) + OUT_W'(up)) << (dropped - DROPPED_W'(RIGHT));
  // A normal word has a bit at the place of the leading one of the least normal number, or above.
  wire is_flushed = FLUSH != 0 && ~|(rounded >> (P - 1));
  wire [W-1:0] limited = is_flushed ? {W{1'b0}} : rounded > MAX ? W'(MAX) : W'(rounded);
  assign word = negative ? (S != 0 ? -limited : {W{1'b0}}) : limited;
endmodule

`default_nettype wire
