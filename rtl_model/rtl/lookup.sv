// Lookup: a function of one argument, read from a ROM, to nearest or with linear interpolation. RTL
// implementation of functions/table.rs.
//
//   argument = [ address | fraction ]     nearest:  word = value[address]
//                                         linear:   word = value[address] + delta[address] * fraction
//
// Loss: the result of an interpolation is quantised to the format of the values; it is always in
// its range.
`timescale 1ns / 1ps
`default_nettype none

module lookup #(
    parameter int ARGUMENT_W = 2,          // bits of the argument, address and fraction
    parameter int TABLE_BITS = 1,          // bits of the address
    parameter int LINEAR = 0,              // 1: straight lines between the values
    parameter int W = 1,                   // bits of a value, unsigned, and of the word
    parameter int ROUND = 1,               // how the word is rounded: 0 truncate, 1 nearest (ties up), 2 nearest-even
    parameter int P = 0,                   // significant bits of a floating-point word; 0 in fixed point
    parameter int FLUSH = 0,               // 1: its subnormal words are flushed to zero
    parameter ROM = "table.hex",           // lines {value, signed delta of W + 1 bits}
    parameter int LINES = 1 << TABLE_BITS  // number of them: fewer than addresses if tables of several materials are in one ROM
) (
    input wire [ARGUMENT_W-1:0] argument, // the argument
    output wire [W-1:0] word              // the function's value
);
  localparam int FRACTION_BITS = ARGUMENT_W - TABLE_BITS;

  logic [2*W:0] lines[0:LINES-1];
  initial $readmemh(ROM, lines);

  wire [TABLE_BITS-1:0] address = TABLE_BITS'(argument >> FRACTION_BITS);
  wire [2*W:0] line = lines[address];
  wire [W-1:0] value = line[2*W:W+1];

  if (LINEAR != 0 && FRACTION_BITS > 0) begin : g_linear
    // As wide as the values at the ends of a step: the result is between them.
    localparam int EXACT_W = W + FRACTION_BITS + 2;
    wire signed [W:0] delta = line[W:0];
    wire signed [FRACTION_BITS:0] fraction = {1'b0, argument[FRACTION_BITS-1:0]};
    wire signed [EXACT_W-1:0] rise = delta * fraction;
    wire signed [EXACT_W-1:0] exact = ($signed(EXACT_W'(value)) <<< FRACTION_BITS) + rise;
    if (P == 0) begin : g_fixed
      fit #(.IN_W(EXACT_W), .PLACES(FRACTION_BITS), .W(W), .S(0), .ROUND(ROUND), .WRAP(0)) between (.exact(exact), .word(word));
    end else begin : g_float
      fit_float #(.IN_W(EXACT_W), .PLACES(FRACTION_BITS), .W(W), .S(0), .P(P), .ROUND(ROUND), .FLUSH(FLUSH)) between (.exact(exact), .word(word));
    end
  end else begin : g_nearest
    assign word = value;
    wire unused_delta = &line[W:0];
  end
endmodule

`default_nettype wire
