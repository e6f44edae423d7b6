// Reciprocal: 1/x by leading-zero normalisation, a table and Newton steps. RTL implementation of
// functions/reciprocal.rs.
//
//   x ->[<< lz]-> m in [1,2) -+->[table]-> y0 ->( c = 2 - m*y )*steps -> y in [1/2,1]
//         +-> exponent e      +---------------->( y = y*c     )          1/x = y * 2^e
//
// Losses: the mantissa m is truncated (rounding up could leave [1,2)); the correction c and the
// result y are rounded to nearest.
`timescale 1ns / 1ps
`default_nettype none

module reciprocal #(
    parameter int IN_W = 2,             // bits of the operand
    parameter int IN_F = 0,             // its fraction bits
    parameter int BITS = 4,             // fraction bits of the mantissas, which are U1F{BITS}
    parameter int TABLE_BITS = 1,       // bits of the table's address
    parameter int NEWTON_STEPS = 0,     // steps after the table
    parameter ROM = "reciprocal.hex"    // the table
) (
    input wire [IN_W-1:0] x,            // the operand, never 0
    output wire [BITS:0] mantissa,      // 1/x is this
    output wire signed [7:0] exponent   // times 2 to the power of this
);
  localparam int W = BITS + 1;
  localparam int PRODUCT_W = 2 * W;
  localparam [PRODUCT_W:0] TWO = (PRODUCT_W + 1)'(2) << (2 * BITS);

  wire [IN_W-1:0] normalised;
  wire signed [7:0] lead;
  normalise #(.W(IN_W), .LEAD_W(8)) normaliser (.value(x), .normalised(normalised), .lead(lead));
  assign exponent = lead + 8'(IN_F + 1 - IN_W);

  wire signed [IN_W:0] natural = {1'b0, normalised};
  wire [W-1:0] m;
  fit #(.IN_W(IN_W + 1), .PLACES(IN_W - 1 - BITS), .W(W), .S(0), .ROUND(0), .WRAP(0))
      fit_mantissa (.exact(natural), .word(m));

  logic [W-1:0] guesses[0:2**TABLE_BITS-1];
  initial $readmemh(ROM, guesses);
  // Its leading one is constant.
  wire [TABLE_BITS-1:0] address = TABLE_BITS'(m >> (BITS - TABLE_BITS));

  for (genvar step = 0; step <= NEWTON_STEPS; step++) begin : g_step
    wire [W-1:0] y;
    if (step == 0) begin : g_guess
      assign y = guesses[address];
    end else begin : g_newton
      wire [PRODUCT_W-1:0] nearly_one = m * g_step[step-1].y;
      wire signed [PRODUCT_W:0] correct = TWO - {1'b0, nearly_one};
      wire [W-1:0] correction;
      fit #(.IN_W(PRODUCT_W + 1), .PLACES(BITS), .W(W), .S(0), .ROUND(1), .WRAP(0))
          fit_correction (.exact(correct), .word(correction));
      wire [PRODUCT_W-1:0] product = g_step[step-1].y * correction;
      wire signed [PRODUCT_W:0] better = {1'b0, product};
      fit #(.IN_W(PRODUCT_W + 1), .PLACES(BITS), .W(W), .S(0), .ROUND(1), .WRAP(0)) fit_result (.exact(better), .word(y));
    end
  end
  assign mantissa = g_step[NEWTON_STEPS].y;
endmodule

`default_nettype wire
