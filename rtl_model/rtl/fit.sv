// Fit: quantises an exact result to a word, the only operation that loses bits. RTL implementation
// of num/fit.rs, Fit::one.
//
//   exact ->(<< left)->(+ round)->(>> right)->[ saturate | wrap ]-> word
//
// Loss: bits below the word's LSB are rounded; outside its range the word saturates or wraps.
`timescale 1ns / 1ps
`default_nettype none

module fit #(
    parameter int IN_W = 1,   // bits of the exact result
    parameter int PLACES = 0, // its fraction bits less those of the word
    parameter int W = 1,      // bits of the word
    parameter int S = 0,      // 1: the word is signed
    parameter int ROUND = 1,  // 0 truncate, 1 nearest (ties up), 2 nearest-even
    parameter int WRAP = 0    // 0 saturate, 1 wrap
) (
    input wire signed [IN_W-1:0] exact, // the exact result
    output wire [W-1:0] word            // the word
);
  // Larger shifts do not change the word: to the left only a limit remains, to the right only the
  // sign.
  localparam int LEFT = PLACES >= 0 ? 0 : -PLACES < W ? -PLACES : W;
  localparam int RIGHT = PLACES <= 0 ? 0 : PLACES < IN_W ? PLACES : IN_W;
  // Rounding up may need one more bit.
  localparam int SUM_W = IN_W + LEFT + 1;
  localparam int CUT_W = SUM_W - RIGHT;
  localparam [W-1:0] MIN = S != 0 ? W'(1) << (W - 1) : {W{1'b0}};
  localparam [W-1:0] MAX = S != 0 ? ~MIN : {W{1'b1}};
  // Half of the remaining LSB.
  localparam [SUM_W-1:0] HALF = (SUM_W'(1) << RIGHT) >> 1;

  wire signed [SUM_W-1:0] shifted = SUM_W'(exact) <<< LEFT;
  wire signed [SUM_W-1:0] rounded;
  if (RIGHT == 0 || ROUND == 0) begin : g_truncate
    assign rounded = shifted;
  end else if (ROUND == 1) begin : g_nearest
    assign rounded = shifted + $signed(HALF);
  end else begin : g_nearest_even
    // A tie is rounded down, unless the truncated word is odd.
    assign rounded = shifted + $signed(HALF - SUM_W'(1)) + $signed({{(SUM_W - 1) {1'b0}}, shifted[RIGHT]});
  end
  wire signed [CUT_W-1:0] cut = CUT_W'(rounded >>> RIGHT);

  // In range if all bits above the word's magnitude are equal, and are not a sign that the word
  // cannot have.
  wire signed [CUT_W-1:0] above = cut >>> (W - S);
  wire negative = cut[CUT_W-1];
  wire low = negative && (S == 0 || !(&above));
  wire high = !negative && |above;
  assign word = WRAP != 0 ? W'(cut) : low ? MIN : high ? MAX : W'(cut);
endmodule

`default_nettype wire
