// Raster: walks a splat's box at one pixel per cycle, and outputs a fragment if the radial index is
// below the cutoff (forward differencing, or products). RTL implementation of units/raster.rs.
//
//   splat ->[ seed ]-> radial ->(+)->(+)-> ...    r at each pixel centre: by_column += by_column_twice, radial += by_column
//               +-> by_column ->(+)--+
//               +------> z ->(+)-> ...            z of the tangent plane, clamped to depth +- depth_range on its way out
//
// Either each row is seeded, or rows are differenced like pixels. Whether a pixel gives a fragment
// is decided at the end of the registers. Each pixel therefore takes a place, and a pixel without a
// fragment returns it there. The walk does not depend on seeds and tests: its loop is a counter of
// pixels and a counter of places, and the computation of a splat's first pixel is in no loop.
//
// In a tile, the part of the box inside the tile is walked. The seeds are those of the whole box,
// at its own first column, or pixel, and the registers advance to the tile in closed form. The
// picture therefore does not depend on the tiles.
//
// If each pixel is evaluated (MACHINE_DIRECT), only z is differenced:
//
//   pixel ->(-)-> px, py ->(x)-> squares ->(x conic)->(+)-> radial
//
// Losses: offset, gradient, the seeds of radial and z, and the differences are rounded. A radial
// index below 0, which differencing can give, is replaced by 0. With MACHINE_DIRECT offset, square
// and radial are rounded, and a pixel below 0 makes no fragment.
`timescale 1ns / 1ps
`default_nettype none

module raster #(
    parameter int TAG_W = 32, // bits of the tag
    parameter int SIDE = 0    // columns and rows of a tile, a power of two; 0: boxes are not clipped
) (
    input wire clk,                              // clock, rising edge
    input wire rst,                              // clears the splat and its fragments
    input wire [machine_pkg::FRAME_W-1:0] frame, // constants: the picture's size, the cutoff
    input wire [machine_pkg::RASTER_OUT_X_W+machine_pkg::RASTER_OUT_Y_W-1:0] corner, // of a tile: its first column and row, while it is drawn
    input wire s_valid,                          // a splat is there
    output wire s_ready,                         // and can be taken, with its first pixel
    input wire [TAG_W+machine_pkg::RASTER_IN_W-machine_pkg::RASTER_IN_TAG_W-1:0] s_data, // raster.in
    output wire m_valid,                         // a fragment is offered
    input wire m_ready,                          // and taken
    output wire [TAG_W+machine_pkg::RASTER_OUT_W-machine_pkg::RASTER_OUT_TAG_W-1:0] m_data // raster.out
);
  localparam int IN_W = TAG_W + machine_pkg::RASTER_IN_W - machine_pkg::RASTER_IN_TAG_W;
  localparam int OUT_W = TAG_W + machine_pkg::RASTER_OUT_W - machine_pkg::RASTER_OUT_TAG_W;
  localparam int COLUMN_W = machine_pkg::RASTER_OUT_X_W;
  localparam int ROW_W = machine_pkg::RASTER_OUT_Y_W;
  localparam int RADIAL_W = machine_pkg::RASTER_RADIAL_W;
  localparam int Z_W = machine_pkg::RASTER_DEPTH_W;
  localparam int SLOPE_W = machine_pkg::ELLIPSE_DEPTH_SLOPE_W;

  // The walk: it stores its splat between pixels, with the registers of the next pixel.
  logic walking;
  logic [IN_W-1:0] held;
  logic [COLUMN_W-1:0] column;
  logic [ROW_W-1:0] row;
`ifndef MACHINE_DIRECT
  logic signed [RADIAL_W-1:0] radial, by_column;
`endif
  logic signed [Z_W-1:0] z;

  // The splat of this cycle's pixel.
  wire [IN_W-1:0] splat = walking ? held : s_data;
  wire [TAG_W-1:0] tag = splat[IN_W-1-:TAG_W];
  wire signed [machine_pkg::PROJECT_PIXEL_W-1:0] pixel_x = splat[machine_pkg::RASTER_IN_PIXEL_X_LSB+:machine_pkg::PROJECT_PIXEL_W];
  wire signed [machine_pkg::PROJECT_PIXEL_W-1:0] pixel_y = splat[machine_pkg::RASTER_IN_PIXEL_Y_LSB+:machine_pkg::PROJECT_PIXEL_W];
  wire signed [machine_pkg::ELLIPSE_CONIC_W:0] xx = {1'b0, splat[machine_pkg::RASTER_IN_CONIC_XX_LSB+:machine_pkg::ELLIPSE_CONIC_W]};
  wire signed [machine_pkg::ELLIPSE_CONIC_CROSS_W-1:0] xy =
      splat[machine_pkg::RASTER_IN_CONIC_XY_LSB+:machine_pkg::ELLIPSE_CONIC_CROSS_W];
  wire signed [machine_pkg::ELLIPSE_CONIC_W:0] yy = {1'b0, splat[machine_pkg::RASTER_IN_CONIC_YY_LSB+:machine_pkg::ELLIPSE_CONIC_W]};
  wire signed [machine_pkg::PROJECT_DEPTH_W:0] depth = {1'b0, splat[machine_pkg::RASTER_IN_DEPTH_LSB+:machine_pkg::PROJECT_DEPTH_W]};
  wire signed [SLOPE_W-1:0] slope_x = splat[machine_pkg::RASTER_IN_DEPTH_SLOPE_X_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] slope_y = splat[machine_pkg::RASTER_IN_DEPTH_SLOPE_Y_LSB+:SLOPE_W];
  wire signed [machine_pkg::ELLIPSE_DEPTH_RANGE_W:0] depth_range =
      {1'b0, splat[machine_pkg::RASTER_IN_DEPTH_RANGE_LSB+:machine_pkg::ELLIPSE_DEPTH_RANGE_W]};
  wire [COLUMN_W-1:0] first_column = splat[machine_pkg::RASTER_IN_FIRST_COLUMN_LSB+:COLUMN_W];
  wire [COLUMN_W-1:0] last_column = splat[machine_pkg::RASTER_IN_LAST_COLUMN_LSB+:COLUMN_W];
  wire [ROW_W-1:0] first_row = splat[machine_pkg::RASTER_IN_FIRST_ROW_LSB+:ROW_W];
  wire [ROW_W-1:0] last_row = splat[machine_pkg::RASTER_IN_LAST_ROW_LSB+:ROW_W];

  // The part of the box that is walked: its sides, and the number of columns and rows of the box
  // before it.
  wire [COLUMN_W-1:0] left, right, columns_on;
  wire [ROW_W-1:0] top, bottom, rows_on;
  if (SIDE > 0) begin : g_part
    wire [COLUMN_W-1:0] tile_left = corner[ROW_W+:COLUMN_W];
    wire [ROW_W-1:0] tile_top = corner[ROW_W-1:0];
    wire [COLUMN_W-1:0] tile_right = tile_left + COLUMN_W'(SIDE - 1);
    wire [ROW_W-1:0] tile_bottom = tile_top + ROW_W'(SIDE - 1);
    assign left = first_column < tile_left ? tile_left : first_column;
    assign right = last_column > tile_right ? tile_right : last_column;
    assign top = first_row < tile_top ? tile_top : first_row;
    assign bottom = last_row > tile_bottom ? tile_bottom : last_row;
    assign columns_on = left - first_column;
    assign rows_on = top - first_row;
  end else begin : g_whole
    assign {left, right, top, bottom} = {first_column, last_column, first_row, last_row};
    assign {columns_on, rows_on} = '0;
  end

  // This cycle's pixel.
  wire [COLUMN_W-1:0] x = walking ? column : left;
  wire [ROW_W-1:0] y = walking ? row : top;
  wire last_of_row = x == right;
  wire last_of_box = last_of_row && y == bottom;

  // Seed, offsets: from the splat's centre to that of the first pixel of the box, or of its row
  // here. The picture's middle is at half its size.
  localparam int OFFSET_W = machine_pkg::RASTER_OFFSET_W;
  localparam int OFFSET_F = machine_pkg::RASTER_OFFSET_F;
  localparam int PIXEL_F = machine_pkg::PROJECT_PIXEL_F;
  localparam int MIDDLE_W = (COLUMN_W > ROW_W ? COLUMN_W : ROW_W) + 2;
  localparam int CENTRE_W = MIDDLE_W + PIXEL_F - 1;
  localparam int DISTANCE_W = (CENTRE_W > machine_pkg::PROJECT_PIXEL_W ? CENTRE_W : machine_pkg::PROJECT_PIXEL_W) + 1;

  wire [machine_pkg::FRAME_WIDTH_W-1:0] width = frame[machine_pkg::FRAME_WIDTH_LSB+:machine_pkg::FRAME_WIDTH_W];
  wire [machine_pkg::FRAME_HEIGHT_W-1:0] height = frame[machine_pkg::FRAME_HEIGHT_LSB+:machine_pkg::FRAME_HEIGHT_W];
  wire [ROW_W-1:0] seed_row = machine_pkg::RASTER_DIFFERENCED != 0 ? first_row : y;
  wire signed [MIDDLE_W-1:0] from_middle_x = $signed(MIDDLE_W'({first_column, 1'b1}) - MIDDLE_W'(width));
  wire signed [MIDDLE_W-1:0] from_middle_y = $signed(MIDDLE_W'({seed_row, 1'b1}) - MIDDLE_W'(height));
  wire signed [DISTANCE_W-1:0] distance_x = (DISTANCE_W'(from_middle_x) <<< (PIXEL_F - 1)) - DISTANCE_W'(pixel_x);
  wire signed [DISTANCE_W-1:0] distance_y = (DISTANCE_W'(from_middle_y) <<< (PIXEL_F - 1)) - DISTANCE_W'(pixel_y);
  wire signed [OFFSET_W-1:0] dx, dy;
  fit #(.IN_W(DISTANCE_W), .PLACES(PIXEL_F - OFFSET_F), .W(OFFSET_W), .S(1), .ROUND(machine_pkg::RASTER_OFFSET_ROUND),
      .WRAP(machine_pkg::RASTER_OFFSET_WRAP)) offset_x (.exact(distance_x), .word(dx));
  fit #(.IN_W(DISTANCE_W), .PLACES(PIXEL_F - OFFSET_F), .W(OFFSET_W), .S(1), .ROUND(machine_pkg::RASTER_OFFSET_ROUND),
      .WRAP(machine_pkg::RASTER_OFFSET_WRAP)) offset_y (.exact(distance_y), .word(dy));

`ifdef MACHINE_DIRECT
  // r of this cycle's pixel: its own offset, three squares, and their products with the conic.
  localparam int SQUARE_W = machine_pkg::RASTER_SQUARE_W;
  localparam int SQUARE_F = machine_pkg::RASTER_SQUARE_F;
  localparam int ALONG_W = machine_pkg::ELLIPSE_CONIC_W + 1 + SQUARE_W;
  localparam int ACROSS_W = machine_pkg::ELLIPSE_CONIC_CROSS_W + 1 + SQUARE_W;
  localparam int SUM_W = (ALONG_W > ACROSS_W ? ALONG_W : ACROSS_W) + 2;

  wire signed [MIDDLE_W-1:0] middle_x = $signed(MIDDLE_W'({x, 1'b1}) - MIDDLE_W'(width));
  wire signed [MIDDLE_W-1:0] middle_y = $signed(MIDDLE_W'({y, 1'b1}) - MIDDLE_W'(height));
  wire signed [DISTANCE_W-1:0] apart_x = (DISTANCE_W'(middle_x) <<< (PIXEL_F - 1)) - DISTANCE_W'(pixel_x);
  wire signed [DISTANCE_W-1:0] apart_y = (DISTANCE_W'(middle_y) <<< (PIXEL_F - 1)) - DISTANCE_W'(pixel_y);
  wire signed [OFFSET_W-1:0] px, py;
  fit #(.IN_W(DISTANCE_W), .PLACES(PIXEL_F - OFFSET_F), .W(OFFSET_W), .S(1), .ROUND(machine_pkg::RASTER_OFFSET_ROUND),
      .WRAP(machine_pkg::RASTER_OFFSET_WRAP)) own_x (.exact(apart_x), .word(px));
  fit #(.IN_W(DISTANCE_W), .PLACES(PIXEL_F - OFFSET_F), .W(OFFSET_W), .S(1), .ROUND(machine_pkg::RASTER_OFFSET_ROUND),
      .WRAP(machine_pkg::RASTER_OFFSET_WRAP)) own_y (.exact(apart_y), .word(py));

  wire signed [2*OFFSET_W-1:0] exact_x = px * px;
  wire signed [2*OFFSET_W-1:0] exact_both = px * py;
  wire signed [2*OFFSET_W-1:0] exact_y = py * py;
  wire signed [SQUARE_W-1:0] square_x, square_both, square_y;
  fit #(.IN_W(2 * OFFSET_W), .PLACES(2 * OFFSET_F - SQUARE_F), .W(SQUARE_W), .S(1), .ROUND(machine_pkg::RASTER_SQUARE_ROUND),
      .WRAP(machine_pkg::RASTER_SQUARE_WRAP)) of_x (.exact(exact_x), .word(square_x));
  fit #(.IN_W(2 * OFFSET_W), .PLACES(2 * OFFSET_F - SQUARE_F), .W(SQUARE_W), .S(1), .ROUND(machine_pkg::RASTER_SQUARE_ROUND),
      .WRAP(machine_pkg::RASTER_SQUARE_WRAP)) of_both (.exact(exact_both), .word(square_both));
  fit #(.IN_W(2 * OFFSET_W), .PLACES(2 * OFFSET_F - SQUARE_F), .W(SQUARE_W), .S(1), .ROUND(machine_pkg::RASTER_SQUARE_ROUND),
      .WRAP(machine_pkg::RASTER_SQUARE_WRAP)) of_y (.exact(exact_y), .word(square_y));

  wire signed [SUM_W-1:0] sum = SUM_W'(xx) * square_x + ((SUM_W'(xy) * square_both) <<< (1 + machine_pkg::ELLIPSE_CONIC_F - machine_pkg::ELLIPSE_CONIC_CROSS_F)) + SUM_W'(yy) * square_y;
  wire signed [RADIAL_W-1:0] radial_here;
  fit #(.IN_W(SUM_W), .PLACES(machine_pkg::ELLIPSE_CONIC_F + SQUARE_F - machine_pkg::RASTER_RADIAL_F), .W(RADIAL_W), .S(1),
      .ROUND(machine_pkg::RASTER_RADIAL_ROUND), .WRAP(machine_pkg::RASTER_RADIAL_WRAP)) evaluated (.exact(sum), .word(radial_here));
`else
  // Seed, r: conic words times offsets, and their sums, all with the same fraction bits. Slants and
  // steps are by column, or by row.
  localparam int CONIC_F = machine_pkg::ELLIPSE_CONIC_F;
  localparam int GRADIENT_W = machine_pkg::RASTER_GRADIENT_W;
  localparam int ALONG_W = machine_pkg::ELLIPSE_CONIC_W + OFFSET_W;
  localparam int ACROSS_W = machine_pkg::ELLIPSE_CONIC_CROSS_W + OFFSET_W + 1;
  localparam int TERM_W = ALONG_W + 1 > ACROSS_W ? ALONG_W + 1 : ACROSS_W;
  localparam int SLANT_W = TERM_W + 1;
  localparam int STEP_W = TERM_W + 2;
  localparam int FIRST_W = machine_pkg::RASTER_FIRST_W;
  localparam int SQUARE_W = OFFSET_W + GRADIENT_W + 1;
  // Left shifts to a register's fraction bits.
  localparam int FIRST_LEFT = machine_pkg::RASTER_RADIAL_F - machine_pkg::RASTER_FIRST_F;

  wire signed [ALONG_W-1:0] along_x = xx * dx;
  wire signed [ALONG_W-1:0] along_y = yy * dy;
  wire signed [ACROSS_W-1:0] across_y = (ACROSS_W'(xy) * dy) <<< 1;
  wire signed [SLANT_W-1:0] slant_x = SLANT_W'(along_x) + SLANT_W'(across_y);
  wire signed [GRADIENT_W-1:0] by_x, by_y;
  fit #(.IN_W(SLANT_W), .PLACES(CONIC_F + OFFSET_F - machine_pkg::RASTER_GRADIENT_F), .W(GRADIENT_W), .S(1),
      .ROUND(machine_pkg::RASTER_GRADIENT_ROUND), .WRAP(machine_pkg::RASTER_GRADIENT_WRAP)) gradient_x (.exact(slant_x), .word(by_x));
  fit #(.IN_W(ALONG_W), .PLACES(CONIC_F + OFFSET_F - machine_pkg::RASTER_GRADIENT_F), .W(GRADIENT_W), .S(1),
      .ROUND(machine_pkg::RASTER_GRADIENT_ROUND), .WRAP(machine_pkg::RASTER_GRADIENT_WRAP)) gradient_y (.exact(along_y), .word(by_y));

  wire signed [STEP_W-1:0] step_x = (STEP_W'(along_x) <<< 1) + (STEP_W'(xx) <<< OFFSET_F) + STEP_W'(across_y);
  wire signed [FIRST_W-1:0] first_x;
  fit #(.IN_W(STEP_W), .PLACES(CONIC_F + OFFSET_F - machine_pkg::RASTER_FIRST_F), .W(FIRST_W), .S(1),
      .ROUND(machine_pkg::RASTER_FIRST_ROUND), .WRAP(machine_pkg::RASTER_FIRST_WRAP)) first_by_column (.exact(step_x), .word(first_x));
  wire signed [RADIAL_W-1:0] seed_by_column = RADIAL_W'(first_x) <<< FIRST_LEFT;

  wire signed [SQUARE_W-1:0] square = SQUARE_W'(dx) * by_x + SQUARE_W'(dy) * by_y;
  wire signed [RADIAL_W-1:0] seed_radial;
  fit #(.IN_W(SQUARE_W), .PLACES(OFFSET_F + machine_pkg::RASTER_GRADIENT_F - machine_pkg::RASTER_RADIAL_F), .W(RADIAL_W), .S(1),
      .ROUND(machine_pkg::RASTER_RADIAL_ROUND), .WRAP(machine_pkg::RASTER_RADIAL_WRAP)) radial_seed (.exact(square), .word(seed_radial));
`endif

  // Seed, z.
  localparam int LEAN_W = SLOPE_W + OFFSET_W + 1;
  localparam int LEAN_F = machine_pkg::ELLIPSE_DEPTH_SLOPE_F + OFFSET_F;
  localparam int PLANE_F = LEAN_F > machine_pkg::PROJECT_DEPTH_F ? LEAN_F : machine_pkg::PROJECT_DEPTH_F;
  localparam int LEAN_LEFT = PLANE_F - LEAN_F;
  localparam int CAMERA_LEFT = PLANE_F - machine_pkg::PROJECT_DEPTH_F;
  localparam int LEANING_W = LEAN_W + LEAN_LEFT;
  localparam int CAMERA_W = machine_pkg::PROJECT_DEPTH_W + 1 + CAMERA_LEFT;
  localparam int PLANE_W = (LEANING_W > CAMERA_W ? LEANING_W : CAMERA_W) + 1;

  wire signed [LEAN_W-1:0] lean = LEAN_W'(slope_x) * dx + LEAN_W'(slope_y) * dy;
  wire signed [PLANE_W-1:0] plane = (PLANE_W'(lean) <<< LEAN_LEFT) + (PLANE_W'(depth) <<< CAMERA_LEFT);
  wire signed [Z_W-1:0] seed_z;
  fit #(.IN_W(PLANE_W), .PLACES(PLANE_F - machine_pkg::RASTER_DEPTH_F), .W(Z_W), .S(1), .ROUND(machine_pkg::RASTER_DEPTH_ROUND),
      .WRAP(machine_pkg::RASTER_DEPTH_WRAP)) z_seed (.exact(plane), .word(seed_z));

  // Steps of z.
  localparam int SLOPE_LEFT = machine_pkg::RASTER_DEPTH_F - machine_pkg::ELLIPSE_DEPTH_SLOPE_F;
  wire signed [Z_W-1:0] z_by_column = Z_W'(slope_x) <<< SLOPE_LEFT;

  wire takes;
`ifdef MACHINE_DIRECT
  // z of each row is seeded, and moved across to the part.
  wire signed [Z_W-1:0] part_z;
  if (SIDE > 0) begin : g_on
    raster_skip #(.W(Z_W), .STEPS_W(COLUMN_W)) z_on (
        .value(seed_z), .first(z_by_column), .second(Z_W'(0)), .steps(columns_on), .skipped(part_z));
  end else begin : g_at_once
    assign part_z = seed_z;
  end
  wire signed [Z_W-1:0] z_here = x == left ? part_z : z;
  wire signed [Z_W-1:0] z_below = z;
`else
  // Differences of r that are equal at all pixels.
  localparam int TWICE_W = (machine_pkg::ELLIPSE_CONIC_W + 1 > machine_pkg::ELLIPSE_CONIC_CROSS_W ? machine_pkg::ELLIPSE_CONIC_W + 1 :
      machine_pkg::ELLIPSE_CONIC_CROSS_W) + 1;
  localparam int SECOND_W = machine_pkg::RASTER_SECOND_W;
  localparam int SECOND_LEFT = machine_pkg::RASTER_RADIAL_F - machine_pkg::RASTER_SECOND_F;

  wire signed [SECOND_W-1:0] second_x;
  fit #(.IN_W(TWICE_W), .PLACES(CONIC_F - machine_pkg::RASTER_SECOND_F), .W(SECOND_W), .S(1), .ROUND(machine_pkg::RASTER_SECOND_ROUND),
      .WRAP(machine_pkg::RASTER_SECOND_WRAP)) second_by_column (.exact(TWICE_W'(xx) <<< 1), .word(second_x));
  wire signed [RADIAL_W-1:0] by_column_twice = RADIAL_W'(second_x) <<< SECOND_LEFT;

  // From the seed to the first pixel of the part: down, if rows are differenced, then across.
  wire signed [RADIAL_W-1:0] down_radial, down_by_column, part_radial, part_by_column;
  wire signed [Z_W-1:0] down_z, part_z;
  if (SIDE > 0) begin : g_on
    raster_skip #(.W(RADIAL_W), .STEPS_W(COLUMN_W)) radial_on (
        .value(down_radial), .first(down_by_column), .second(by_column_twice), .steps(columns_on), .skipped(part_radial));
    raster_skip #(.W(RADIAL_W), .STEPS_W(COLUMN_W)) by_column_on (
        .value(down_by_column), .first(by_column_twice), .second(RADIAL_W'(0)), .steps(columns_on), .skipped(part_by_column));
    raster_skip #(.W(Z_W), .STEPS_W(COLUMN_W)) z_on (
        .value(down_z), .first(z_by_column), .second(Z_W'(0)), .steps(columns_on), .skipped(part_z));
  end else begin : g_at_once
    assign {part_radial, part_by_column, part_z} = {down_radial, down_by_column, down_z};
  end

  // The registers at this cycle's pixel, and at the next row's first.
  wire signed [RADIAL_W-1:0] radial_here, by_column_here, radial_below, by_column_below;
  wire signed [Z_W-1:0] z_here, z_below;
  wire seeds;
  assign radial_here = seeds ? part_radial : radial;
  assign by_column_here = seeds ? part_by_column : by_column;
  assign z_here = seeds ? part_z : z;

  if (machine_pkg::RASTER_DIFFERENCED != 0) begin : g_differenced
    // The registers at this row's first pixel, and the first difference there by row.
    logic signed [RADIAL_W-1:0] row_radial, row_by_column, by_row;
    logic signed [Z_W-1:0] row_z;
    assign seeds = !walking;

    wire signed [ACROSS_W-1:0] across_x = (ACROSS_W'(xy) * dx) <<< 1;
    wire signed [STEP_W-1:0] step_y = (STEP_W'(along_y) <<< 1) + STEP_W'(across_x) + (STEP_W'(yy) <<< OFFSET_F);
    wire signed [FIRST_W-1:0] first_y;
    fit #(.IN_W(STEP_W), .PLACES(CONIC_F + OFFSET_F - machine_pkg::RASTER_FIRST_F), .W(FIRST_W), .S(1),
        .ROUND(machine_pkg::RASTER_FIRST_ROUND), .WRAP(machine_pkg::RASTER_FIRST_WRAP)) first_by_row (.exact(step_y), .word(first_y));
    wire signed [SECOND_W-1:0] second_y, second_both;
    fit #(.IN_W(TWICE_W), .PLACES(CONIC_F - machine_pkg::RASTER_SECOND_F), .W(SECOND_W), .S(1),
        .ROUND(machine_pkg::RASTER_SECOND_ROUND), .WRAP(machine_pkg::RASTER_SECOND_WRAP))
        second_by_row (.exact(TWICE_W'(yy) <<< 1), .word(second_y));
    fit #(.IN_W(TWICE_W), .PLACES(CONIC_F - machine_pkg::RASTER_SECOND_F), .W(SECOND_W), .S(1),
        .ROUND(machine_pkg::RASTER_SECOND_ROUND), .WRAP(machine_pkg::RASTER_SECOND_WRAP))
        second_by_both (.exact(TWICE_W'(xy) <<< 1), .word(second_both));
    wire signed [RADIAL_W-1:0] by_row_twice = RADIAL_W'(second_y) <<< SECOND_LEFT;
    wire signed [RADIAL_W-1:0] by_both = RADIAL_W'(second_both) <<< SECOND_LEFT;
    wire signed [Z_W-1:0] z_by_row = Z_W'(slope_y) <<< SLOPE_LEFT;

    wire signed [RADIAL_W-1:0] seed_by_row = RADIAL_W'(first_y) <<< FIRST_LEFT;
    wire signed [RADIAL_W-1:0] part_by_row;
    if (SIDE > 0) begin : g_down
      wire [RADIAL_W-1:0] down_by_row;
      raster_skip #(.W(RADIAL_W), .STEPS_W(ROW_W)) radial_down (
          .value(seed_radial), .first(seed_by_row), .second(by_row_twice), .steps(rows_on), .skipped(down_radial));
      raster_skip #(.W(RADIAL_W), .STEPS_W(ROW_W)) by_column_down (
          .value(seed_by_column), .first(by_both), .second(RADIAL_W'(0)), .steps(rows_on), .skipped(down_by_column));
      raster_skip #(.W(RADIAL_W), .STEPS_W(ROW_W)) by_row_down (
          .value(seed_by_row), .first(by_row_twice), .second(RADIAL_W'(0)), .steps(rows_on), .skipped(down_by_row));
      raster_skip #(.W(RADIAL_W), .STEPS_W(COLUMN_W)) by_row_on (
          .value(down_by_row), .first(by_both), .second(RADIAL_W'(0)), .steps(columns_on), .skipped(part_by_row));
      raster_skip #(.W(Z_W), .STEPS_W(ROW_W)) z_down (
          .value(seed_z), .first(z_by_row), .second(Z_W'(0)), .steps(rows_on), .skipped(down_z));
    end else begin : g_at_once
      assign {down_radial, down_by_column, part_by_row, down_z} = {seed_radial, seed_by_column, seed_by_row, seed_z};
    end

    wire signed [RADIAL_W-1:0] row_radial_here = seeds ? part_radial : row_radial;
    wire signed [RADIAL_W-1:0] row_by_column_here = seeds ? part_by_column : row_by_column;
    wire signed [RADIAL_W-1:0] by_row_here = seeds ? part_by_row : by_row;
    wire signed [Z_W-1:0] row_z_here = seeds ? part_z : row_z;
    assign radial_below = row_radial_here + by_row_here;
    assign by_column_below = row_by_column_here + by_both;
    assign z_below = row_z_here + z_by_row;

    always_ff @(posedge clk) begin
      if (takes) begin
        row_radial <= last_of_row ? radial_below : row_radial_here;
        row_by_column <= last_of_row ? by_column_below : row_by_column_here;
        row_z <= last_of_row ? z_below : row_z_here;
        by_row <= last_of_row ? by_row_here + by_row_twice : by_row_here;
      end
    end
  end else begin : g_seeded
    // The previous contents are overwritten by the seeds.
    assign seeds = x == left;
    assign {down_radial, down_by_column, down_z} = {seed_radial, seed_by_column, seed_z};
    assign {radial_below, by_column_below, z_below} = {radial, by_column, z};
  end
`endif

  // Fragment: a pixel below the cutoff.
  localparam int EXACT_W = machine_pkg::RASTER_OUT_DEPTH_W;
  localparam int EXACT_F = machine_pkg::RASTER_EXACT_DEPTH_F;

  wire [machine_pkg::RASTER_CUTOFF_W-1:0] cutoff = frame[machine_pkg::FRAME_CUTOFF_LSB+:machine_pkg::RASTER_CUTOFF_W];
  wire signed [RADIAL_W-1:0] limit = $signed(RADIAL_W'(cutoff) << (machine_pkg::RASTER_RADIAL_F - machine_pkg::RASTER_CUTOFF_F));
`ifdef MACHINE_DIRECT
  wire kept = !radial_here[RADIAL_W-1] && radial_here < limit;
  wire [RADIAL_W-1:0] natural = radial_here;
`else
  wire kept = radial_here < limit;
  wire [RADIAL_W-1:0] natural = radial_here[RADIAL_W-1] ? '0 : radial_here;
`endif

  wire signed [EXACT_W-1:0] middle = EXACT_W'(depth) <<< (EXACT_F - machine_pkg::PROJECT_DEPTH_F);
  wire signed [EXACT_W-1:0] reach = EXACT_W'(depth_range) <<< (EXACT_F - machine_pkg::ELLIPSE_DEPTH_RANGE_F);
  wire signed [EXACT_W-1:0] nearest = middle - reach;
  wire signed [EXACT_W-1:0] deepest = middle + reach;
  wire signed [EXACT_W-1:0] exact_z = EXACT_W'(z_here) <<< (EXACT_F - machine_pkg::RASTER_DEPTH_F);
  wire signed [EXACT_W-1:0] clamped = exact_z < nearest ? nearest : exact_z > deepest ? deepest : exact_z;

  // Before its first pixel a splat stays where it was.
  wire here = walking || s_valid;
  wire room;
  assign takes = here && room;
  assign s_ready = !walking && room;
  pipe #(.W(OUT_W), .LATENCY(machine_pkg::RASTER_LATENCY), .INTERVAL(machine_pkg::RASTER_INTERVAL), .ROOM(machine_pkg::RASTER_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(here), .s_ready(room), .s_keeps(kept), .s_data({tag, x, y, natural, clamped}),
      .m_valid(m_valid), .m_ready(m_ready), .m_data(m_data));

  always_ff @(posedge clk) begin
    if (rst) walking <= 1'b0;
    else if (takes) walking <= !last_of_box;
    if (takes) begin
      held <= splat;
      column <= last_of_row ? left : x + COLUMN_W'(1);
      row <= last_of_row ? y + ROW_W'(1) : y;
`ifndef MACHINE_DIRECT
      radial <= last_of_row ? radial_below : radial_here + by_column_here;
      by_column <= last_of_row ? by_column_below : by_column_here + by_column_twice;
`endif
      z <= last_of_row ? z_below : z_here + z_by_column;
    end
  end

  wire unused = &{1'b0, frame, corner, columns_on, rows_on};
endmodule

`default_nettype wire
