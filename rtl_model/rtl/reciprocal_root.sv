// Reciprocal root: 1/sqrt(x), and the operands of sqrt(x), by leading-zero normalisation, a table
// and Newton steps. RTL implementation of functions/square_root.rs.
//
//   x ->[<< even lz]-> m in [1,4) -+->[table]-> y0 ->( q = y*y       )*steps -> y in (1/2,1]
//         +-> exponent -2e         |                 ( c = 3 - m*q   )          1/sqrt(x) = y * 2^e
//                                  +---------------->( y = 1/2*y*c   )          sqrt(x) = m*y * 2^-e
//
// Losses: the mantissa m is truncated (rounding up could leave [1,4)); the square q, the correction
// c and the result y are rounded to nearest.
`timescale 1ns / 1ps
`default_nettype none

module reciprocal_root #(
    parameter int IN_W = 2,             // bits of the operand
    parameter int IN_F = 0,             // its fraction bits
    parameter int BITS = 4,             // fraction bits of the mantissas, which are U1F{BITS}
    parameter int TABLE_BITS = 1,       // bits of the table's address
    parameter int NEWTON_STEPS = 0,     // steps after the table
    parameter ROM = "root.hex"          // the table
) (
    input wire [IN_W-1:0] x,            // the operand, never 0
    output wire [BITS:0] operand,       // its mantissa m, U2F{BITS-1}
    output wire [BITS:0] mantissa,      // 1/sqrt(x) is this
    output wire signed [7:0] exponent   // times 2 to the power of this
);
  localparam int W = BITS + 1;
  localparam int PRODUCT_W = 2 * W;
  // Half of three: y*c/2 is a plain product if c is halved by wiring.
  localparam [PRODUCT_W:0] HALF_THREE = (PRODUCT_W + 1)'(3) << (2 * BITS - 1);

  wire [IN_W-1:0] normalised;
  wire signed [7:0] lead;
  normalise #(.W(IN_W), .LEAD_W(8)) normaliser (.value(x), .normalised(normalised), .lead(lead));
  // One place less if the power of two would be odd.
  wire signed [7:0] twice = lead + 8'(IN_F + 2 - IN_W);
  wire odd = twice[0];
  wire signed [IN_W+1:0] even = odd ? {2'b0, normalised} : {1'b0, normalised, 1'b0};
  assign exponent = twice >>> 1;

  wire [W-1:0] m;
  fit #(.IN_W(IN_W + 2), .PLACES(IN_W - BITS), .W(W), .S(0), .ROUND(0), .WRAP(0)) fit_mantissa (.exact(even), .word(m));
  assign operand = m;

  logic [W-1:0] guesses[0:2**TABLE_BITS-1];
  initial $readmemh(ROM, guesses);
  wire [TABLE_BITS-1:0] address = TABLE_BITS'(m >> (W - TABLE_BITS));

  for (genvar step = 0; step <= NEWTON_STEPS; step++) begin : g_step
    wire [W-1:0] y;
    if (step == 0) begin : g_guess
      assign y = guesses[address];
    end else begin : g_newton
      wire [PRODUCT_W-1:0] squared = g_step[step-1].y * g_step[step-1].y;
      wire signed [PRODUCT_W:0] natural = {1'b0, squared};
      wire [W-1:0] square;
      fit #(.IN_W(PRODUCT_W + 1), .PLACES(BITS), .W(W), .S(0), .ROUND(1), .WRAP(0)) fit_square (.exact(natural), .word(square));
      wire [PRODUCT_W-1:0] nearly_half = m * square;
      wire signed [PRODUCT_W:0] nearly_one = HALF_THREE - {1'b0, nearly_half};
      wire [W-1:0] half_correction;
      fit #(.IN_W(PRODUCT_W + 1), .PLACES(BITS), .W(W), .S(0), .ROUND(1), .WRAP(0))
          fit_correction (.exact(nearly_one), .word(half_correction));
      wire [PRODUCT_W-1:0] product = g_step[step-1].y * half_correction;
      wire signed [PRODUCT_W:0] better = {1'b0, product};
      fit #(.IN_W(PRODUCT_W + 1), .PLACES(BITS), .W(W), .S(0), .ROUND(1), .WRAP(0)) fit_result (.exact(better), .word(y));
    end
  end
  assign mantissa = g_step[NEWTON_STEPS].y;
endmodule

`default_nettype wire
