// Windows_sum: the sum of two slots' sums. RTL implementation of one lane of `summed` in
// units/fragment/window.rs.
//
// Loss: it saturates (or wraps).
`timescale 1ns / 1ps
`default_nettype none

module windows_sum #(
    parameter int W = 1,   // bits of a sum
    parameter int S = 0,   // 1: it is signed
    parameter int WRAP = 0 // 0 saturate, 1 wrap
) (
    input wire [W-1:0] one,   // of one slot
    input wire [W-1:0] other, // of the other
    output wire [W-1:0] sum   // of both
);
  wire signed [W:0] wide_one = {S != 0 && one[W-1], one};
  wire signed [W:0] wide_other = {S != 0 && other[W-1], other};
  wire signed [W+1:0] exact = (W + 2)'(wide_one) + (W + 2)'(wide_other);
  fit #(.IN_W(W + 2), .PLACES(0), .W(W), .S(S), .ROUND(0), .WRAP(WRAP)) fit_sum (.exact(exact), .word(sum));
endmodule

`default_nettype wire
