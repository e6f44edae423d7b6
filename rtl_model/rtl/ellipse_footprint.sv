// Ellipse_footprint: computes conic and box from a shape and the areas of its faces. RTL
// implementation of `footprint` in units/ellipse.rs.
//
//   shape ->(* k'^2)->(+ v/4^e)-> variance V' -+---------------------------> extent -> box
//                                              +--------------->(*)--------> conic
//   faces ->(* k'^2)-> areas -> determinant ->[ 1/sqrt ]-> inverse -^
//
// A disc has one face, an ellipsoid three.
//
// Losses: every word is rounded. The extent has one more LSB than necessary, so the box never loses
// a pixel.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_footprint #(
    parameter int FACES = 1,    // faces
    parameter int POWER_W = 10, // bits of e
    parameter ROMS = "rom/"     // folder of the tables, with its slash
) (
    // Only the low pass and the picture's size are used of the frame's constants.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                             // constants: the view
    // verilator lint_on UNUSEDSIGNAL
    input wire [machine_pkg::RASTER_CUTOFF_W-1:0] cutoff,                    // where the box ends
    input wire [2*machine_pkg::PROJECT_PIXEL_W-1:0] pixels_from_middle,      // centre, x in the most significant bits
    input wire [3*machine_pkg::ELLIPSE_SIZE_SQUARED_W-1:0] sizes_squared,    // k'_x^2, k'_x*k'_y, k'_y^2, the first on top
    input wire signed [POWER_W-1:0] exponent,                                // e
    input wire signed [machine_pkg::ELLIPSE_SHAPE_W-1:0] shape_xx,           // the variance of size 1
    input wire signed [machine_pkg::ELLIPSE_SHAPE_W-1:0] shape_xy,           // likewise
    input wire signed [machine_pkg::ELLIPSE_SHAPE_W-1:0] shape_yy,           // likewise
    input wire [FACES*machine_pkg::ELLIPSE_FACING_W-1:0] faces,              // the first in the lowest bits
    output wire [FACES*machine_pkg::ELLIPSE_AREA_W-1:0] areas,               // likewise, of this size
    output wire [machine_pkg::ELLIPSE_ROOT_BITS:0] root,                     // 1/sqrt det V' is this
    output wire signed [7:0] root_exponent,                                  // times 2 to the power of this
    output wire flat,                                                        // det V' is 0
    output wire [machine_pkg::ELLIPSE_CONIC_W-1:0] conic_xx,                 // the conic
    output wire [machine_pkg::ELLIPSE_CONIC_CROSS_W-1:0] conic_xy,           // likewise
    output wire [machine_pkg::ELLIPSE_CONIC_W-1:0] conic_yy,                 // likewise
    output wire [2*machine_pkg::ELLIPSE_OUT_FIRST_COLUMN_W-1:0] firsts,      // first column and row, the row in the low bits
    output wire [2*machine_pkg::ELLIPSE_OUT_FIRST_COLUMN_W-1:0] lasts,       // last column and row
    output wire outside                                                      // the box is outside the picture
);
  localparam int PIXEL_W = machine_pkg::PROJECT_PIXEL_W;
  localparam int PIXEL_F = machine_pkg::PROJECT_PIXEL_F;
  localparam int FACING_W = machine_pkg::ELLIPSE_FACING_W;
  localparam int FACING_F = machine_pkg::ELLIPSE_FACING_F;
  localparam int SIZE_SQUARED_W = machine_pkg::ELLIPSE_SIZE_SQUARED_W;
  localparam int SIZE_SQUARED_F = machine_pkg::ELLIPSE_SIZE_SQUARED_F;
  localparam int SHAPE_W = machine_pkg::ELLIPSE_SHAPE_W;
  localparam int SHAPE_F = machine_pkg::ELLIPSE_SHAPE_F;
  localparam int LOW_PASS_W = machine_pkg::ELLIPSE_LOW_PASS_W;
  localparam int LOW_PASS_F = machine_pkg::ELLIPSE_LOW_PASS_F;
  localparam int VARIANCE_W = machine_pkg::ELLIPSE_VARIANCE_W;
  localparam int VARIANCE_F = machine_pkg::ELLIPSE_VARIANCE_F;
  localparam int CROSS_W = machine_pkg::ELLIPSE_VARIANCE_CROSS_W;
  localparam int CROSS_F = machine_pkg::ELLIPSE_VARIANCE_CROSS_F;
  localparam int AREA_W = machine_pkg::ELLIPSE_AREA_W;
  localparam int AREA_F = machine_pkg::ELLIPSE_AREA_F;
  localparam int DETERMINANT_W = machine_pkg::ELLIPSE_DETERMINANT_W;
  localparam int DETERMINANT_F = machine_pkg::ELLIPSE_DETERMINANT_F;
  localparam int ROOT_BITS = machine_pkg::ELLIPSE_ROOT_BITS;
  localparam int INVERSE_W = machine_pkg::ELLIPSE_INVERSE_W;
  localparam int INVERSE_F = machine_pkg::ELLIPSE_INVERSE_F;
  localparam int CONIC_W = machine_pkg::ELLIPSE_CONIC_W;
  localparam int CONIC_F = machine_pkg::ELLIPSE_CONIC_F;
  localparam int CONIC_CROSS_W = machine_pkg::ELLIPSE_CONIC_CROSS_W;
  localparam int CONIC_CROSS_F = machine_pkg::ELLIPSE_CONIC_CROSS_F;
  localparam int CUTOFF_W = machine_pkg::RASTER_CUTOFF_W;
  localparam int EXTENT_BITS = machine_pkg::ELLIPSE_EXTENT_ROOT_BITS;
  localparam int EXTENT_W = machine_pkg::ELLIPSE_EXTENT_W;
  localparam int EXTENT_F = machine_pkg::ELLIPSE_EXTENT_F;
  localparam int COLUMN_W = machine_pkg::ELLIPSE_OUT_FIRST_COLUMN_W;
  localparam int PIXELS_W = machine_pkg::FRAME_WIDTH_W;
  // An edge of the box in whole pixels: a picture has up to 16384.
  localparam int EDGE_W = 17;

  wire signed [LOW_PASS_W:0] filter = {1'b0, frame[machine_pkg::FRAME_LOW_PASS_LSB+:LOW_PASS_W]};
  wire signed [POWER_W:0] twice_exponent = {exponent, 1'b0};
  wire [LOW_PASS_W-1:0] low_pass;
  fit_shifted #(.IN_W(LOW_PASS_W + 1), .PLACES(0), .MORE_W(POWER_W + 1), .W(LOW_PASS_W), .S(0), .ROUND(machine_pkg::ELLIPSE_LOW_PASS_ROUND),
      .WRAP(machine_pkg::ELLIPSE_LOW_PASS_WRAP)) fit_low_pass (.exact(filter), .more(twice_exponent), .word(low_pass));


  // Variance V': k'^2 * shape and the low pass.
  localparam int SPREAD_F = SIZE_SQUARED_F + SHAPE_F;
  localparam int SPREAD_W = SIZE_SQUARED_W + SHAPE_W;
  localparam int VARIED_F = SPREAD_F > LOW_PASS_F ? SPREAD_F : LOW_PASS_F;
  localparam int SPREAD_LEFT = VARIED_F - SPREAD_F;
  localparam int FILTER_LEFT = VARIED_F - LOW_PASS_F;
  localparam int SPREADS_W = SPREAD_W + SPREAD_LEFT;
  localparam int FILTERED_W = LOW_PASS_W + 1 + FILTER_LEFT;
  localparam int VARIED_W = (SPREADS_W > FILTERED_W ? SPREADS_W : FILTERED_W) + 1;
  wire signed [VARIED_W-1:0] spread_xx = $signed({1'b0, sizes_squared[2*SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * shape_xx;
  wire signed [SPREAD_W-1:0] spread_xy = $signed({1'b0, sizes_squared[SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * shape_xy;
  wire signed [VARIED_W-1:0] spread_yy = $signed({1'b0, sizes_squared[0+:SIZE_SQUARED_W]}) * shape_yy;
  wire signed [VARIED_W-1:0] filtered = VARIED_W'($signed({1'b0, low_pass})) <<< FILTER_LEFT;
  wire signed [VARIED_W-1:0] varied_xx = (spread_xx <<< SPREAD_LEFT) + filtered, varied_yy = (spread_yy <<< SPREAD_LEFT) + filtered;
  wire [VARIANCE_W-1:0] variance_xx, variance_yy;
  wire signed [CROSS_W-1:0] variance_cross;
  fit #(.IN_W(VARIED_W), .PLACES(VARIED_F - VARIANCE_F), .W(VARIANCE_W), .S(0), .ROUND(machine_pkg::ELLIPSE_VARIANCE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_VARIANCE_WRAP)) fit_variance_xx (.exact(varied_xx), .word(variance_xx));
  fit #(.IN_W(SPREAD_W), .PLACES(SPREAD_F - CROSS_F), .W(CROSS_W), .S(1), .ROUND(machine_pkg::ELLIPSE_VARIANCE_CROSS_ROUND),
      .WRAP(machine_pkg::ELLIPSE_VARIANCE_CROSS_WRAP)) fit_variance_cross (.exact(spread_xy), .word(variance_cross));
  fit #(.IN_W(VARIED_W), .PLACES(VARIED_F - VARIANCE_F), .W(VARIANCE_W), .S(0), .ROUND(machine_pkg::ELLIPSE_VARIANCE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_VARIANCE_WRAP)) fit_variance_yy (.exact(varied_yy), .word(variance_yy));

  // det V' = sum of area^2 + v' * tr V' - v'^2.
  for (genvar face = 0; face < FACES; face++) begin : g_area
    wire signed [FACING_W-1:0] facing = faces[face*FACING_W+:FACING_W];
    wire signed [SIZE_SQUARED_W+FACING_W-1:0] turned = $signed({1'b0, sizes_squared[SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * facing;
    fit #(.IN_W(SIZE_SQUARED_W + FACING_W), .PLACES(SIZE_SQUARED_F + FACING_F - AREA_F), .W(AREA_W), .S(1),
        .ROUND(machine_pkg::ELLIPSE_AREA_ROUND), .WRAP(machine_pkg::ELLIPSE_AREA_WRAP))
        fit_area (.exact(turned), .word(areas[face*AREA_W+:AREA_W]));
  end
  localparam int TRACED_F = LOW_PASS_F + VARIANCE_F;
  localparam int LEAST_F = 2 * AREA_F > 2 * LOW_PASS_F ? 2 * AREA_F : 2 * LOW_PASS_F;
  localparam int DETERMINED_F = LEAST_F > TRACED_F ? LEAST_F : TRACED_F;
  localparam int AREAS_W = 2 * AREA_W + DETERMINED_F - 2 * AREA_F;
  localparam int TRACED_W = LOW_PASS_W + VARIANCE_W + 2 + DETERMINED_F - TRACED_F;
  localparam int FILTERS_W = 2 * LOW_PASS_W + 1 + DETERMINED_F - 2 * LOW_PASS_F;
  localparam int MOST_W = AREAS_W > TRACED_W ? AREAS_W : TRACED_W;
  localparam int DETERMINED_W = (MOST_W > FILTERS_W ? MOST_W : FILTERS_W) + 2 + $clog2(FACES);
  wire [VARIANCE_W:0] trace = {1'b0, variance_xx} + {1'b0, variance_yy};
  wire signed [DETERMINED_W-1:0] squares;
  for (genvar face = 0; face < FACES; face++) begin : g_square
    wire signed [AREA_W-1:0] area = areas[face*AREA_W+:AREA_W];
    wire signed [DETERMINED_W-1:0] area_squared = area * area;
    wire signed [DETERMINED_W-1:0] so_far;
    if (face == 0) begin : g_first
      assign so_far = area_squared;
    end else begin : g_next
      assign so_far = g_square[face-1].so_far + area_squared;
    end
  end
  assign squares = g_square[FACES-1].so_far;
  wire signed [DETERMINED_W-1:0] traced = $signed({1'b0, low_pass}) * $signed({1'b0, trace});
  wire signed [DETERMINED_W-1:0] filter_squared = $signed({1'b0, low_pass}) * $signed({1'b0, low_pass});
  wire signed [DETERMINED_W-1:0] determined = (squares <<< (DETERMINED_F - 2 * AREA_F)) + (traced <<< (DETERMINED_F - TRACED_F))
      - (filter_squared <<< (DETERMINED_F - 2 * LOW_PASS_F));
  wire [DETERMINANT_W-1:0] some_determinant;
  fit #(.IN_W(DETERMINED_W), .PLACES(DETERMINED_F - DETERMINANT_F), .W(DETERMINANT_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_DETERMINANT_ROUND), .WRAP(machine_pkg::ELLIPSE_DETERMINANT_WRAP))
      fit_determinant (.exact(determined), .word(some_determinant));
  assign flat = some_determinant == '0;
  wire [DETERMINANT_W-1:0] determinant = flat ? DETERMINANT_W'(1) : some_determinant;

  wire [ROOT_BITS:0] unused_operand;
  reciprocal_root #(.IN_W(DETERMINANT_W), .IN_F(DETERMINANT_F), .BITS(ROOT_BITS), .TABLE_BITS(machine_pkg::ELLIPSE_ROOT_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::ELLIPSE_ROOT_NEWTON_STEPS), .ROM({ROMS, "ellipse.root.hex"}))
      rooter (.x(determinant), .operand(unused_operand), .mantissa(root), .exponent(root_exponent));

  // Conic: V' rotated by 90 degrees and divided by its determinant.
  wire signed [2*ROOT_BITS+2:0] root_squared = $signed({1'b0, root}) * $signed({1'b0, root});
  wire [INVERSE_W-1:0] inverse;
  fit #(.IN_W(2 * ROOT_BITS + 3), .PLACES(2 * ROOT_BITS - INVERSE_F), .W(INVERSE_W), .S(0), .ROUND(machine_pkg::ELLIPSE_INVERSE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_INVERSE_WRAP)) fit_inverse (.exact(root_squared), .word(inverse));
  wire signed [POWER_W:0] conic_exponent = (POWER_W + 1)'(exponent) - (POWER_W + 1)'(root_exponent);
  wire signed [POWER_W+1:0] conic_more = {conic_exponent, 1'b0};
  localparam int INVERTED_W = VARIANCE_W + INVERSE_W + 1;
  localparam int INVERTED_CROSS_W = CROSS_W + INVERSE_W + 1;
  wire signed [INVERTED_W-1:0] inverted_xx = $signed({1'b0, variance_yy}) * $signed({1'b0, inverse});
  wire signed [INVERTED_CROSS_W-1:0] inverted_cross = variance_cross * $signed({1'b0, inverse}), inverted_xy = -inverted_cross;
  wire signed [INVERTED_W-1:0] inverted_yy = $signed({1'b0, variance_xx}) * $signed({1'b0, inverse});
  fit_shifted #(.IN_W(INVERTED_W), .PLACES(VARIANCE_F + INVERSE_F - CONIC_F), .MORE_W(POWER_W + 2), .W(CONIC_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_CONIC_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_WRAP))
      fit_conic_xx (.exact(inverted_xx), .more(conic_more), .word(conic_xx));
  fit_shifted #(.IN_W(INVERTED_CROSS_W), .PLACES(CROSS_F + INVERSE_F - CONIC_CROSS_F), .MORE_W(POWER_W + 2), .W(CONIC_CROSS_W), .S(1),
      .ROUND(machine_pkg::ELLIPSE_CONIC_CROSS_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_CROSS_WRAP))
      fit_conic_xy (.exact(inverted_xy), .more(conic_more), .word(conic_xy));
  fit_shifted #(.IN_W(INVERTED_W), .PLACES(VARIANCE_F + INVERSE_F - CONIC_F), .MORE_W(POWER_W + 2), .W(CONIC_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_CONIC_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_WRAP))
      fit_conic_yy (.exact(inverted_yy), .more(conic_more), .word(conic_yy));

  // The box: first and last row and column, inside the picture; the first is greater than the last
  // if the box is empty.
  localparam int REACH_W = CUTOFF_W + VARIANCE_W;
  localparam int ROOTED_W = 2 * EXTENT_BITS + 3;
  localparam int BOUND_F = PIXEL_F > EXTENT_F ? PIXEL_F : EXTENT_F;
  localparam int SIDE_W = PIXEL_W - PIXEL_F > EXTENT_W - EXTENT_F + 2 ? PIXEL_W - PIXEL_F : EXTENT_W - EXTENT_F + 2;
  localparam int BOUND_W = (SIDE_W > PIXELS_W + 1 ? SIDE_W : PIXELS_W + 1) + BOUND_F + 2;
  wire [1:0] missed;
  for (genvar i = 0; i < 2; i++) begin : g_side
    wire [VARIANCE_W-1:0] variance = i == 0 ? variance_yy : variance_xx;
    wire [REACH_W-1:0] some_reach = cutoff * variance;
    wire [REACH_W-1:0] reach = some_reach == '0 ? REACH_W'(1) : some_reach;
    wire [EXTENT_BITS:0] reach_operand, reach_root;
    wire signed [7:0] reach_exponent;
    reciprocal_root #(.IN_W(REACH_W), .IN_F(machine_pkg::RASTER_CUTOFF_F + VARIANCE_F), .BITS(EXTENT_BITS),
        .TABLE_BITS(machine_pkg::ELLIPSE_EXTENT_ROOT_TABLE_BITS), .NEWTON_STEPS(machine_pkg::ELLIPSE_EXTENT_ROOT_NEWTON_STEPS),
        .ROM({ROMS, "ellipse.extent_root.hex"}))
        extent_rooter (.x(reach), .operand(reach_operand), .mantissa(reach_root), .exponent(reach_exponent));
    wire signed [ROOTED_W-1:0] rooted = $signed({1'b0, reach_operand}) * $signed({1'b0, reach_root});
    wire signed [POWER_W:0] extent_more = (POWER_W + 1)'(reach_exponent) - (POWER_W + 1)'(exponent);
    wire [EXTENT_W-1:0] extent;
    fit_shifted #(.IN_W(ROOTED_W), .PLACES(2 * EXTENT_BITS - 1 - EXTENT_F), .MORE_W(POWER_W + 1), .W(EXTENT_W), .S(0),
        .ROUND(machine_pkg::ELLIPSE_EXTENT_ROUND), .WRAP(machine_pkg::ELLIPSE_EXTENT_WRAP))
        fit_extent (.exact(rooted), .more(extent_more), .word(extent));

    wire signed [PIXELS_W:0] pixels = {1'b0, frame[machine_pkg::FRAME_HEIGHT_LSB+i*PIXELS_W+:PIXELS_W]};
    wire signed [PIXELS_W:0] last_px = pixels - (PIXELS_W + 1)'(1);
    wire signed [PIXEL_W-1:0] pixel = pixels_from_middle[i*PIXEL_W+:PIXEL_W];
    // From the centre of pixel 0 to the picture's middle: half of last_px.
    wire signed [BOUND_W-1:0] centre = (BOUND_W'(pixel) <<< (BOUND_F - PIXEL_F)) + (BOUND_W'(last_px) <<< (BOUND_F - 1));
    // One LSB more than the value, so that rounding never loses a pixel.
    wire signed [BOUND_W-1:0] reached = (BOUND_W'($signed({1'b0, extent})) + BOUND_W'(1)) <<< (BOUND_F - EXTENT_F);
    wire signed [BOUND_W-1:0] first_bound = centre - reached + BOUND_W'(2 ** BOUND_F - 1);
    wire signed [BOUND_W-1:0] last_bound = centre + reached;
    wire signed [EDGE_W-1:0] first_edge, last_edge;
    fit #(.IN_W(BOUND_W), .PLACES(BOUND_F), .W(EDGE_W), .S(1), .ROUND(0), .WRAP(0)) fit_first (.exact(first_bound), .word(first_edge));
    fit #(.IN_W(BOUND_W), .PLACES(BOUND_F), .W(EDGE_W), .S(1), .ROUND(0), .WRAP(0)) fit_last (.exact(last_bound), .word(last_edge));
    wire signed [EDGE_W-1:0] first = first_edge < EDGE_W'(0) ? EDGE_W'(0) : first_edge;
    wire signed [EDGE_W-1:0] last = last_edge > EDGE_W'(last_px) ? EDGE_W'(last_px) : last_edge;
    assign missed[i] = first > last;
    assign firsts[i*COLUMN_W+:COLUMN_W] = COLUMN_W'(first);
    assign lasts[i*COLUMN_W+:COLUMN_W] = COLUMN_W'(last);
  end
  assign outside = |missed;
endmodule

`default_nettype wire
