// Dot: the exact product of two vectors. RTL implementation of num/words.rs, Words::dot.
//
//   a, b ->( a_x*b_x + a_y*b_y + a_z*b_z )-> sum
//
// Loss: none.
`timescale 1ns / 1ps
`default_nettype none

module dot #(
    parameter int A_W = 1, // bits of a part of one vector
    parameter int B_W = 1  // bits of a part of the other
) (
    input wire [3*A_W-1:0] a,             // three signed parts, the first in the most significant bits
    input wire [3*B_W-1:0] b,             // likewise
    output wire signed [A_W+B_W:0] sum    // their product
);
  localparam int SUM_W = A_W + B_W + 1;

  wire signed [A_W-1:0] a_x = a[2*A_W+:A_W], a_y = a[A_W+:A_W], a_z = a[0+:A_W];
  wire signed [B_W-1:0] b_x = b[2*B_W+:B_W], b_y = b[B_W+:B_W], b_z = b[0+:B_W];
  wire signed [A_W+B_W-1:0] x = a_x * b_x, y = a_y * b_y, z = a_z * b_z;
  assign sum = SUM_W'(x) + SUM_W'(y) + SUM_W'(z);
endmodule

`default_nettype wire
