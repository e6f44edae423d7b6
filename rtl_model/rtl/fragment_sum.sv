// Fragment_sum: adds weight * attribute to one sum of a fragment. RTL implementation of one lane of
// units/fragment.rs, accumulate.
//
//   sum ------------------(+)->[ fit ]-> next
//   weight ->(x)-----------^
//   attribute ^
//
// Loss: the sum is rounded once per contribution, and saturates (or wraps).
`timescale 1ns / 1ps
`default_nettype none

module fragment_sum #(
    parameter int ATTRIBUTE_W = 1, // bits of the attribute
    parameter int ATTRIBUTE_F = 0, // its fraction bits
    parameter int ATTRIBUTE_S = 0, // 1: it is signed
    parameter int W = 1,           // bits of the sum
    parameter int F = 0,           // its fraction bits
    parameter int S = 0,           // 1: it is signed
    parameter int ROUND = 1,       // 0 truncate, 1 nearest (ties up), 2 nearest-even
    parameter int WRAP = 0         // 0 saturate, 1 wrap
) (
    input wire [W-1:0] sum,                            // before
    input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] weight, // of the contribution
    input wire [ATTRIBUTE_W-1:0] attribute,            // of its splat
    output wire [W-1:0] next                           // after
);
  localparam int WEIGHT_W = machine_pkg::GAUSS_WEIGHT_W;
  // A product has one unused sign bit if the attribute is signed.
  localparam int PRODUCT_W = WEIGHT_W + ATTRIBUTE_W + 1;
  localparam int PRODUCT_F = machine_pkg::GAUSS_WEIGHT_F + ATTRIBUTE_F;
  localparam int OF_SUM = PRODUCT_F > F ? PRODUCT_F - F : 0;
  localparam int OF_PRODUCT = F > PRODUCT_F ? F - PRODUCT_F : 0;
  localparam int ALIGNED_W = W + 1 + OF_SUM > PRODUCT_W + OF_PRODUCT ? W + 1 + OF_SUM : PRODUCT_W + OF_PRODUCT;
  localparam int EXACT_W = ALIGNED_W + 1;

  wire signed [W:0] held = {S != 0 && sum[W-1], sum};
  wire signed [ATTRIBUTE_W:0] factor = {ATTRIBUTE_S != 0 && attribute[ATTRIBUTE_W-1], attribute};
  wire signed [PRODUCT_W-1:0] product = PRODUCT_W'($signed({1'b0, weight})) * PRODUCT_W'(factor);
  wire signed [EXACT_W-1:0] exact = (EXACT_W'(held) <<< OF_SUM) + (EXACT_W'(product) <<< OF_PRODUCT);
  fit #(.IN_W(EXACT_W), .PLACES(OF_SUM), .W(W), .S(S), .ROUND(ROUND), .WRAP(WRAP)) fit_sum (.exact(exact), .word(next));
endmodule

`default_nettype wire
