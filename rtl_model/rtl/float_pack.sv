// Float pack: the stored bits of a floating-point word: sign, exponent and fraction. RTL
// implementation of num/float.rs, Format::stored.
//
//   word ->( magnitude )->( leading one )-> { sign, exponent, fraction }
//
// Loss: none.
`timescale 1ns / 1ps
`default_nettype none

module float_pack #(
    parameter int W = 4, // bits of the word, from its sign to its least place
    parameter int S = 0, // 1: the word is signed
    parameter int P = 2, // its significant bits
    parameter int E = 2  // bits of its exponent
) (
    input wire [W-1:0] word,            // the word
    output wire [S+E+P-2:0] stored      // the stored bits
);
  wire [W-1:0] magnitude = S != 0 && word[W-1] ? -word : word;

  logic [E-1:0] shift;
  always_comb begin
    shift = '0;
    for (int place = P; place < W; place++) begin
      if (magnitude[place]) shift = E'(place - P + 1);
    end
  end

  // The leading one of a normal number adds 1 to the exponent.
  wire [E+P-2:0] code = {shift, {(P - 1) {1'b0}}} + (E + P - 1)'(magnitude >> shift);
  if (S != 0) begin : g_signed
    assign stored = {word[W-1], code};
  end else begin : g_unsigned
    assign stored = code;
  end
endmodule

`default_nettype wire
