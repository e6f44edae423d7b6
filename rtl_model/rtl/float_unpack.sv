// Float unpack: a floating-point word from its stored bits: sign, exponent and fraction. RTL
// implementation of num/float.rs, Format::restored.
//
//   { sign, exponent, fraction } ->[ << exponent ]->( sign )-> word
//
// Loss: none.
`timescale 1ns / 1ps
`default_nettype none

module float_unpack #(
    parameter int W = 4, // bits of the word, from its sign to its least place
    parameter int S = 0, // 1: the word is signed
    parameter int P = 2, // its significant bits
    parameter int E = 2  // bits of its exponent
) (
    input wire [S+E+P-2:0] stored, // the stored bits
    output wire [W-1:0] word       // the word
);
  wire [E-1:0] exponent = stored[P-1+:E];
  wire normal = |exponent;
  wire [W-1:0] significand = W'({normal, stored[P-2:0]});
  wire [W-1:0] magnitude = significand << (normal ? exponent - E'(1) : E'(0));
  if (S != 0) begin : g_signed
    assign word = stored[S+E+P-2] ? -magnitude : magnitude;
  end else begin : g_unsigned
    assign word = magnitude;
  end
endmodule

`default_nettype wire
