// Colour: turns spherical harmonics and the viewing direction into the colour of a splat. RTL
// implementation of units/colour.rs.
//
//   position ->(- eye)->[ << ]-> relative -+->[ 1/sqrt ]->(*)-> direction ->(*)-> monomial ->(*)-> basis
//                                          +---------------^
//   coefficients ->( sum of coefficient * polynomial )->(+ 1/2)-> at least 0 -> rgb
//
// Losses: relative is truncated by its normaliser; direction, monomial, basis and rgb are rounded.
// The reciprocal root lists the losses of its inner words.
`timescale 1ns / 1ps
`default_nettype none

module colour #(
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the table, with its slash
) (
    input wire clk,                                          // clock, rising edge
    input wire rst,                                          // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,             // constants: the eye
    input wire s_valid,                                      // a splat is there
    output wire s_ready,                                     // and can be taken
    input wire [TAG_W+machine_pkg::COLOUR_IN_W-1:0] s_data,  // the tag, colour.in
    output wire m_valid,                                     // a colour is offered
    input wire m_ready,                                      // and taken
    output wire [TAG_W+machine_pkg::COLOUR_OUT_W-1:0] m_data // the tag, colour.out
);
  localparam int DEGREE = machine_pkg::COLOUR_DEGREE;
  localparam int COUNT = (DEGREE + 1) * (DEGREE + 1);
  localparam int POSITION_W = machine_pkg::SPLAT_POSITION_W;
  localparam int EYE_W = machine_pkg::PROJECT_EYE_W;
  localparam int COEFFICIENT_W = machine_pkg::COLOUR_COEFFICIENT_W;
  localparam int RELATIVE_W = machine_pkg::COLOUR_RELATIVE_W;
  localparam int RELATIVE_F = machine_pkg::COLOUR_RELATIVE_F;
  localparam int ROOT_BITS = machine_pkg::COLOUR_ROOT_BITS;
  localparam int DIRECTION_W = machine_pkg::COLOUR_DIRECTION_W;
  localparam int DIRECTION_F = machine_pkg::COLOUR_DIRECTION_F;
  localparam int MONOMIAL_W = machine_pkg::COLOUR_MONOMIAL_W;
  localparam int MONOMIAL_F = machine_pkg::COLOUR_MONOMIAL_F;
  localparam int BASIS_W = machine_pkg::COLOUR_BASIS_W;
  localparam int BASIS_F = machine_pkg::COLOUR_BASIS_F;
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;

  // Position and eye with a common binary point.
  localparam int DIFFERENCE_F = machine_pkg::SPLAT_POSITION_F > machine_pkg::PROJECT_EYE_F ? machine_pkg::SPLAT_POSITION_F : machine_pkg::PROJECT_EYE_F;
  localparam int POSITION_LEFT = DIFFERENCE_F - machine_pkg::SPLAT_POSITION_F;
  localparam int EYE_LEFT = DIFFERENCE_F - machine_pkg::PROJECT_EYE_F;
  localparam int MAGNITUDE_W = POSITION_W + POSITION_LEFT > EYE_W + EYE_LEFT ? POSITION_W + POSITION_LEFT : EYE_W + EYE_LEFT;
  localparam int DIFFERENCE_W = MAGNITUDE_W + 1;
  // Sums of monomials, at most eight times as large as one.
  localparam int SUM_W = MONOMIAL_W + 3;
  // Polynomials with a common binary point.
  localparam int LOW_F = DIRECTION_F > MONOMIAL_F ? DIRECTION_F : MONOMIAL_F;
  localparam int POLYNOMIAL_F = LOW_F > BASIS_F ? LOW_F : BASIS_F;
  localparam int LINEAR_W = DIRECTION_W + POLYNOMIAL_F - DIRECTION_F;
  localparam int SQUARE_W = SUM_W + POLYNOMIAL_F - MONOMIAL_F;
  localparam int CUBIC_W = BASIS_W + POLYNOMIAL_F - BASIS_F;
  localparam int LOW_W = LINEAR_W > SQUARE_W ? LINEAR_W : SQUARE_W;
  localparam int POLYNOMIAL_W = LOW_W > CUBIC_W ? LOW_W : CUBIC_W;
  // The sum of up to 15 products, of the constant coefficient and of 1/2.
  localparam int PRODUCT_F = machine_pkg::COLOUR_COEFFICIENT_F + POLYNOMIAL_F;
  localparam int CONSTANT_F = machine_pkg::COLOUR_COEFFICIENT_F > 1 ? machine_pkg::COLOUR_COEFFICIENT_F : 1;
  localparam int WHOLE_F = PRODUCT_F > CONSTANT_F ? PRODUCT_F : CONSTANT_F;
  localparam int PRODUCT_LEFT = WHOLE_F - PRODUCT_F;
  localparam int CONSTANT_LEFT = WHOLE_F - machine_pkg::COLOUR_COEFFICIENT_F;
  localparam int FAR_W = COEFFICIENT_W + POLYNOMIAL_W + PRODUCT_LEFT > COEFFICIENT_W + CONSTANT_LEFT ?
      COEFFICIENT_W + POLYNOMIAL_W + PRODUCT_LEFT : COEFFICIENT_W + CONSTANT_LEFT;
  localparam int WHOLE_W = (FAR_W > WHOLE_F + 1 ? FAR_W : WHOLE_F + 1) + 5;

  // Vectors are packed as in a record: z, y, x from the LSB on.
  wire signed [7:0] lead;
  wire [3*MAGNITUDE_W-1:0] magnitude;
  wire [3*RELATIVE_W-1:0] relative;
  for (genvar i = 0; i < 3; i++) begin : g_relative
    wire signed [POSITION_W-1:0] position = s_data[machine_pkg::COLOUR_IN_POSITION_Z_LSB+i*POSITION_W+:POSITION_W];
    wire signed [EYE_W-1:0] eye = frame[machine_pkg::FRAME_EYE_Z_LSB+i*EYE_W+:EYE_W];
    wire signed [DIFFERENCE_W-1:0] difference = (DIFFERENCE_W'(position) <<< POSITION_LEFT) - (DIFFERENCE_W'(eye) <<< EYE_LEFT);
    assign magnitude[i*MAGNITUDE_W+:MAGNITUDE_W] = MAGNITUDE_W'(difference[DIFFERENCE_W-1] ? -difference : difference);
    wire signed [DIFFERENCE_W-1:0] normalised = difference <<< lead;
    fit #(.IN_W(DIFFERENCE_W), .PLACES(MAGNITUDE_W - RELATIVE_F), .W(RELATIVE_W), .S(1), .ROUND(machine_pkg::COLOUR_RELATIVE_ROUND),
        .WRAP(machine_pkg::COLOUR_RELATIVE_WRAP)) fit_relative (.exact(normalised), .word(relative[i*RELATIVE_W+:RELATIVE_W]));
  end
  wire [MAGNITUDE_W-1:0] largest =
      magnitude[2*MAGNITUDE_W+:MAGNITUDE_W] | magnitude[MAGNITUDE_W+:MAGNITUDE_W] | magnitude[0+:MAGNITUDE_W] | MAGNITUDE_W'(1);
  wire [MAGNITUDE_W-1:0] unused_normalised;
  normalise #(.W(MAGNITUDE_W)) normaliser (.value(largest), .normalised(unused_normalised), .lead(lead));

  wire signed [2*RELATIVE_W:0] squared;
  dot #(.A_W(RELATIVE_W), .B_W(RELATIVE_W)) square (.a(relative), .b(relative), .sum(squared));
  wire [2*RELATIVE_W-1:0] positive = squared == '0 ? (2 * RELATIVE_W)'(1) : squared[2*RELATIVE_W-1:0];
  wire [ROOT_BITS:0] unused_operand, inverse;
  wire signed [7:0] exponent;
  reciprocal_root #(.IN_W(2 * RELATIVE_W), .IN_F(2 * RELATIVE_F), .BITS(ROOT_BITS), .TABLE_BITS(machine_pkg::COLOUR_ROOT_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::COLOUR_ROOT_NEWTON_STEPS), .ROM({ROMS, "colour.root.hex"}))
      root (.x(positive), .operand(unused_operand), .mantissa(inverse), .exponent(exponent));

  wire signed [8:0] more = -(9'(exponent));
  wire [3*DIRECTION_W-1:0] direction;
  for (genvar i = 0; i < 3; i++) begin : g_direction
    wire signed [RELATIVE_W-1:0] part = relative[i*RELATIVE_W+:RELATIVE_W];
    wire signed [RELATIVE_W+ROOT_BITS+1:0] scaled = part * $signed({1'b0, inverse});
    fit_shifted #(.IN_W(RELATIVE_W + ROOT_BITS + 2), .PLACES(RELATIVE_F + ROOT_BITS - DIRECTION_F), .MORE_W(9), .W(DIRECTION_W), .S(1),
        .ROUND(machine_pkg::COLOUR_DIRECTION_ROUND), .WRAP(machine_pkg::COLOUR_DIRECTION_WRAP))
        fit_direction (.exact(scaled), .more(more), .word(direction[i*DIRECTION_W+:DIRECTION_W]));
  end
  wire signed [DIRECTION_W-1:0] x = direction[2*DIRECTION_W+:DIRECTION_W];
  wire signed [DIRECTION_W-1:0] y = direction[DIRECTION_W+:DIRECTION_W];
  wire signed [DIRECTION_W-1:0] z = direction[0+:DIRECTION_W];

  // The polynomials in the order of the coefficients, from the second one on.
  wire [(COUNT-1)*POLYNOMIAL_W-1:0] polynomials;
  assign polynomials[0*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(y) <<< (POLYNOMIAL_F - DIRECTION_F);
  assign polynomials[1*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(z) <<< (POLYNOMIAL_F - DIRECTION_F);
  assign polynomials[2*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(x) <<< (POLYNOMIAL_F - DIRECTION_F);
  if (DEGREE > 1) begin : g_squares
    // xx, yy, zz, xy, yz, xz.
    wire [6*DIRECTION_W-1:0] firsts = {x, y, x, z, y, x};
    wire [6*DIRECTION_W-1:0] seconds = {z, z, y, z, y, x};
    wire [6*MONOMIAL_W-1:0] monomials;
    for (genvar i = 0; i < 6; i++) begin : g_monomial
      wire signed [DIRECTION_W-1:0] a = firsts[i*DIRECTION_W+:DIRECTION_W], b = seconds[i*DIRECTION_W+:DIRECTION_W];
      wire signed [2*DIRECTION_W-1:0] product = a * b;
      fit #(.IN_W(2 * DIRECTION_W), .PLACES(2 * DIRECTION_F - MONOMIAL_F), .W(MONOMIAL_W), .S(1), .ROUND(machine_pkg::COLOUR_MONOMIAL_ROUND),
          .WRAP(machine_pkg::COLOUR_MONOMIAL_WRAP)) fit_monomial (.exact(product), .word(monomials[i*MONOMIAL_W+:MONOMIAL_W]));
    end
    wire signed [MONOMIAL_W-1:0] square_x = monomials[0+:MONOMIAL_W], square_y = monomials[MONOMIAL_W+:MONOMIAL_W];
    wire signed [MONOMIAL_W-1:0] square_z = monomials[2*MONOMIAL_W+:MONOMIAL_W], cross_xy = monomials[3*MONOMIAL_W+:MONOMIAL_W];
    wire signed [MONOMIAL_W-1:0] cross_yz = monomials[4*MONOMIAL_W+:MONOMIAL_W], cross_xz = monomials[5*MONOMIAL_W+:MONOMIAL_W];
    wire signed [SUM_W-1:0] xx = SUM_W'(square_x), yy = SUM_W'(square_y), zz = SUM_W'(square_z);
    wire signed [SUM_W-1:0] xy = SUM_W'(cross_xy), yz = SUM_W'(cross_yz), xz = SUM_W'(cross_xz);
    wire signed [SUM_W-1:0] rest = (zz <<< 1) - xx - yy;
    wire signed [SUM_W-1:0] skew = xx - yy;
    assign polynomials[3*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(xy) <<< (POLYNOMIAL_F - MONOMIAL_F);
    assign polynomials[4*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(yz) <<< (POLYNOMIAL_F - MONOMIAL_F);
    assign polynomials[5*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(rest) <<< (POLYNOMIAL_F - MONOMIAL_F);
    assign polynomials[6*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(xz) <<< (POLYNOMIAL_F - MONOMIAL_F);
    assign polynomials[7*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(skew) <<< (POLYNOMIAL_F - MONOMIAL_F);
    if (DEGREE > 2) begin : g_cubics
      wire signed [SUM_W-1:0] to_y = (xx <<< 1) + xx - yy;
      wire signed [SUM_W-1:0] over = (zz <<< 2) - xx - yy;
      wire signed [SUM_W-1:0] to_z = (zz <<< 1) - (xx <<< 1) - xx - (yy <<< 1) - yy;
      wire signed [SUM_W-1:0] to_x = xx - (yy <<< 1) - yy;
      wire [7*DIRECTION_W-1:0] axes = {x, z, x, z, y, x, y};
      wire [7*SUM_W-1:0] factors = {to_x, skew, over, to_z, over, yz, to_y};
      for (genvar i = 0; i < 7; i++) begin : g_basis
        wire signed [DIRECTION_W-1:0] a = axes[i*DIRECTION_W+:DIRECTION_W];
        wire signed [SUM_W-1:0] b = factors[i*SUM_W+:SUM_W];
        wire signed [DIRECTION_W+SUM_W-1:0] product = a * b;
        wire signed [BASIS_W-1:0] basis;
        fit #(.IN_W(DIRECTION_W + SUM_W), .PLACES(DIRECTION_F + MONOMIAL_F - BASIS_F), .W(BASIS_W), .S(1), .ROUND(machine_pkg::COLOUR_BASIS_ROUND),
            .WRAP(machine_pkg::COLOUR_BASIS_WRAP)) fit_basis (.exact(product), .word(basis));
        assign polynomials[(8+i)*POLYNOMIAL_W+:POLYNOMIAL_W] = POLYNOMIAL_W'(basis) <<< (POLYNOMIAL_F - BASIS_F);
      end
    end
  end

  // Blue, green, red from the LSB on, as in the record; the last coefficient is in its lowest bits.
  wire [3*RGB_W-1:0] rgb;
  for (genvar channel = 0; channel < 3; channel++) begin : g_channel
    for (genvar nth = 0; nth < COUNT; nth++) begin : g_term
      wire signed [COEFFICIENT_W-1:0] coefficient = s_data[((COUNT-1-nth)*3+channel)*COEFFICIENT_W+:COEFFICIENT_W];
      wire signed [WHOLE_W-1:0] so_far;
      if (nth == 0) begin : g_constant
        assign so_far = (WHOLE_W'(coefficient) <<< CONSTANT_LEFT) + (WHOLE_W'(1) <<< (WHOLE_F - 1));
      end else begin : g_product
        wire signed [POLYNOMIAL_W-1:0] polynomial = polynomials[(nth-1)*POLYNOMIAL_W+:POLYNOMIAL_W];
        wire signed [COEFFICIENT_W+POLYNOMIAL_W-1:0] product = coefficient * polynomial;
        assign so_far = g_term[nth-1].so_far + (WHOLE_W'(product) <<< PRODUCT_LEFT);
      end
    end
    wire signed [WHOLE_W-1:0] whole = g_term[COUNT-1].so_far;
    wire signed [WHOLE_W-1:0] natural = whole[WHOLE_W-1] ? '0 : whole;
    fit #(.IN_W(WHOLE_W), .PLACES(WHOLE_F - machine_pkg::SPLAT_RGB_F), .W(RGB_W), .S(0), .ROUND(machine_pkg::SPLAT_RGB_ROUND),
        .WRAP(machine_pkg::SPLAT_RGB_WRAP)) fit_rgb (.exact(natural), .word(rgb[channel*RGB_W+:RGB_W]));
  end

  // The frame also has constants for other units.
  wire unused = &{1'b0, frame};

  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::COLOUR_OUT_W;
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::COLOUR_IN_W, rgb});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::COLOUR_LATENCY), .INTERVAL(machine_pkg::COLOUR_INTERVAL), .ROOM(machine_pkg::COLOUR_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(1'b1), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
