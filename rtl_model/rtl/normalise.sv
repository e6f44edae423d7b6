// Normalise: shifts a word left until its leading one is the MSB.
//
//   value ->[ << by decreasing powers of two ]-> normalised
//
// Loss: none.
`timescale 1ns / 1ps
`default_nettype none

module normalise #(
    parameter int W = 2,     // bits of the word
    parameter int LEAD_W = 8 // bits of the number of places
) (
    input wire [W-1:0] value,             // never 0
    output logic [W-1:0] normalised,      // the same with its leading one at the top
    output logic signed [LEAD_W-1:0] lead // places by which it was shifted
);
  localparam int STEPS = $clog2(W);

  always_comb begin
    normalised = value;
    lead = '0;
    // Each step is half as large as the one before: one bit of `lead`.
    for (int step = STEPS - 1; step >= 0; step--) begin
      if ((normalised >> (W - (1 << step))) == '0) begin
        normalised = normalised << (1 << step);
        lead[step] = 1'b1;
      end
    end
  end
endmodule

`default_nettype wire
