// Reflect: adds the mirrored environment to shaded light, seen along the pixel's ray or from far
// away along the viewing axis. RTL implementation of units/shade/reflect.rs. It is instantiated in
// shade.
//
//   pixel ->[ slope ]-> V = -(a, b, 1) -+
//   normal N ->[ N.V ]-----------------+->[ 2(N.V)N - V ]-> R ->[ 1/(|x|+|y|+|z|) ]->(*)-> |x|, |y| ->[ fold ]->[ map ]-> light
//   colour ->(* 1 - reflect)->(+)<-(* reflect*tint)<- light          +-> at most 1 -> colour
//
// Losses: all words are rounded; coordinates and the mixed light are clamped to 1.
`timescale 1ns / 1ps
`default_nettype none

module reflect #(
    parameter ROMS = "rom/" // folder of the tables, with its slash
) (
`ifdef MACHINE_MIRRORS_ALONG_RAYS
    // The frame's constants are those of all units: this one uses the picture's size and the focal
    // length.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,
    // verilator lint_on UNUSEDSIGNAL
    input wire [machine_pkg::SHADE_IN_X_W-1:0] x,           // the pixel's column
    input wire [machine_pkg::SHADE_IN_Y_W-1:0] y,           // and row
`endif
    input wire [3*machine_pkg::SHADE_NORMAL_W-1:0] normal,  // N, turned towards the viewer: x, y, z, the first in the most significant bits
    input wire [machine_pkg::MATERIAL_W-1:0] material,      // a record of a material
    input wire [3*machine_pkg::SHADE_COLOUR_W-1:0] colour,  // what is lit: red, green, blue, likewise
    output wire [3*machine_pkg::SHADE_COLOUR_W-1:0] leaving // with its mirrored light
);
  localparam int NORMAL_W = machine_pkg::SHADE_NORMAL_W;
  localparam int FACING_W = machine_pkg::REFLECT_FACING_W;
  localparam int DIRECTION_W = machine_pkg::REFLECT_DIRECTION_W;
  localparam int DIRECTION_F = machine_pkg::REFLECT_DIRECTION_F;
  localparam int COORDINATE_W = machine_pkg::REFLECT_COORDINATE_W;
  localparam int COORDINATE_F = machine_pkg::REFLECT_COORDINATE_F;
  localparam int LIGHT_W = machine_pkg::REFLECT_LIGHT_W;
  localparam int LIGHT_F = machine_pkg::REFLECT_LIGHT_F;

  // -V: the pixel's ray (a, b, 1), x in the most significant bits; along the axis a and b are 0.
`ifdef MACHINE_MIRRORS_ALONG_RAYS
  localparam int SEEN_W = machine_pkg::REFLECT_SLOPE_W;
  localparam int SEEN_F = machine_pkg::REFLECT_SLOPE_F;
  localparam int SIZE_W = machine_pkg::FRAME_WIDTH_W;
  localparam int PIXEL_W = machine_pkg::PROJECT_PIXEL_W;
  localparam int PIXEL_F = machine_pkg::PROJECT_PIXEL_F;
  localparam int MIDDLE_W = SIZE_W + 1 + PIXEL_F;
  localparam int OFFSET_W = (MIDDLE_W > PIXEL_W ? MIDDLE_W : PIXEL_W) + 1;
  localparam int INVERSE_FOCAL_W = machine_pkg::ELLIPSE_INVERSE_FOCAL_W;
  localparam int SLOPED_W = OFFSET_W + INVERSE_FOCAL_W + 1;
  wire [2*SIZE_W-1:0] place = {SIZE_W'(x), SIZE_W'(y)};
  wire [2*SIZE_W-1:0] size = {frame[machine_pkg::FRAME_WIDTH_LSB+:SIZE_W], frame[machine_pkg::FRAME_HEIGHT_LSB+:SIZE_W]};
  wire [3*SEEN_W-1:0] sights;
  for (genvar axis = 0; axis < 2; axis++) begin : g_slope
    wire [INVERSE_FOCAL_W-1:0] inverse_focal =
        frame[(axis == 0 ? machine_pkg::VIEW_INVERSE_FOCAL_X_LSB : machine_pkg::VIEW_INVERSE_FOCAL_Y_LSB)+:INVERSE_FOCAL_W];
    wire signed [7:0] inverse_focal_places =
        frame[(axis == 0 ? machine_pkg::VIEW_INVERSE_FOCAL_X_PLACES_LSB : machine_pkg::VIEW_INVERSE_FOCAL_Y_PLACES_LSB)+:8];
    wire signed [PIXEL_W-1:0] centre = frame[(axis == 0 ? machine_pkg::FRAME_CENTRE_X_LSB : machine_pkg::FRAME_CENTRE_Y_LSB)+:PIXEL_W];
    // Twice the distance from the middle, and the distance from the principal point.
    wire signed [SIZE_W+1:0] twice =
        $signed({1'b0, place[(1-axis)*SIZE_W+:SIZE_W], 1'b1}) - $signed({2'b0, size[(1-axis)*SIZE_W+:SIZE_W]});
    wire signed [OFFSET_W-1:0] offset = (OFFSET_W'(twice) <<< (PIXEL_F - 1)) - OFFSET_W'(centre);
    wire signed [SLOPED_W-1:0] sloped = offset * $signed({1'b0, inverse_focal});
    fit_shifted #(.IN_W(SLOPED_W), .PLACES(machine_pkg::ELLIPSE_INVERSE_FOCAL_F + PIXEL_F - SEEN_F), .MORE_W(8), .W(SEEN_W), .S(1),
        .ROUND(machine_pkg::REFLECT_SLOPE_ROUND), .WRAP(machine_pkg::REFLECT_SLOPE_WRAP))
        sloper (.exact(sloped), .more(inverse_focal_places), .word(sights[(2-axis)*SEEN_W+:SEEN_W]));
  end
  assign sights[0+:SEEN_W] = SEEN_W'(1) << SEEN_F;
`else
  localparam int SEEN_W = 2;
  localparam int SEEN_F = 0;
  wire [3*SEEN_W-1:0] sights = (3 * SEEN_W)'(1);
`endif

  // N.V, from its negative components.
  localparam int TOWARDS_W = NORMAL_W + SEEN_W + 2;
  wire [3*TOWARDS_W-1:0] along;
  wire signed [TOWARDS_W-1:0] towards = -($signed(along[0+:TOWARDS_W]) + $signed(along[TOWARDS_W+:TOWARDS_W]) + $signed(along[2*TOWARDS_W+:TOWARDS_W]));
  wire signed [FACING_W-1:0] facing;
  fit #(.IN_W(TOWARDS_W), .PLACES(machine_pkg::SHADE_NORMAL_F + SEEN_F - machine_pkg::REFLECT_FACING_F), .W(FACING_W), .S(1),
      .ROUND(machine_pkg::REFLECT_FACING_ROUND), .WRAP(machine_pkg::REFLECT_FACING_WRAP)) facer (.exact(towards), .word(facing));

  // R, and the magnitudes of its components: x, y, z.
  localparam int PRODUCT_W = FACING_W + NORMAL_W;
  localparam int PRODUCT_F = machine_pkg::REFLECT_FACING_F + machine_pkg::SHADE_NORMAL_F;
  localparam int MIRRORED_F = PRODUCT_F > SEEN_F ? PRODUCT_F : SEEN_F;
  localparam int INTEGERS_W = PRODUCT_W - PRODUCT_F > SEEN_W - SEEN_F ? PRODUCT_W - PRODUCT_F : SEEN_W - SEEN_F;
  localparam int MIRRORED_W = (INTEGERS_W > 0 ? INTEGERS_W : 0) + MIRRORED_F + 3;
  wire [3*DIRECTION_W-1:0] magnitudes;
  wire [2:0] less;
  for (genvar axis = 0; axis < 3; axis++) begin : g_axis
    wire signed [NORMAL_W-1:0] part = normal[(2-axis)*NORMAL_W+:NORMAL_W];
    wire signed [PRODUCT_W-1:0] product = facing * part;
    wire signed [SEEN_W-1:0] sight = sights[(2-axis)*SEEN_W+:SEEN_W];
    assign along[axis*TOWARDS_W+:TOWARDS_W] = TOWARDS_W'(part) * TOWARDS_W'(sight);
    wire signed [MIRRORED_W-1:0] twice = (MIRRORED_W'(product) <<< 1) <<< (MIRRORED_F - PRODUCT_F);
    wire signed [MIRRORED_W-1:0] exact = twice + (MIRRORED_W'(sight) <<< (MIRRORED_F - SEEN_F));
    wire signed [DIRECTION_W-1:0] word;
    fit #(.IN_W(MIRRORED_W), .PLACES(MIRRORED_F - DIRECTION_F), .W(DIRECTION_W), .S(1), .ROUND(machine_pkg::REFLECT_DIRECTION_ROUND),
        .WRAP(machine_pkg::REFLECT_DIRECTION_WRAP)) mirror (.exact(exact), .word(word));
    assign less[axis] = word[DIRECTION_W-1];
    assign magnitudes[axis*DIRECTION_W+:DIRECTION_W] = less[axis] ? -word : word;
  end

  // 1 over their sum, which is at least one LSB.
  localparam int SUM_W = DIRECTION_W + 2;
  localparam int INVERSE_W = machine_pkg::REFLECT_RECIPROCAL_BITS + 1;
  wire [SUM_W-1:0] sum = SUM_W'(magnitudes[0+:DIRECTION_W]) + SUM_W'(magnitudes[DIRECTION_W+:DIRECTION_W])
      + SUM_W'(magnitudes[2*DIRECTION_W+:DIRECTION_W]);
  wire [INVERSE_W-1:0] inverse;
  wire signed [7:0] exponent;
  wire signed [7:0] places = -exponent;
  reciprocal #(.IN_W(SUM_W), .IN_F(DIRECTION_F), .BITS(machine_pkg::REFLECT_RECIPROCAL_BITS),
      .TABLE_BITS(machine_pkg::REFLECT_RECIPROCAL_TABLE_BITS), .NEWTON_STEPS(machine_pkg::REFLECT_RECIPROCAL_NEWTON_STEPS),
      .ROM({ROMS, "reflect.reciprocal.hex"}))
      inverter (.x(sum == '0 ? SUM_W'(1) : sum), .mantissa(inverse), .exponent(exponent));

  // On the unfolded octahedron; directions away from the viewer are folded over.
  localparam int LAID_W = DIRECTION_W + INVERSE_W;
  localparam [COORDINATE_W-1:0] COORDINATE_ONE = COORDINATE_W'(1) << COORDINATE_F;
  for (genvar axis = 0; axis < 2; axis++) begin : g_coordinate
    wire [LAID_W-1:0] laid = magnitudes[axis*DIRECTION_W+:DIRECTION_W] * inverse;
    wire [COORDINATE_W-1:0] word;
    fit_shifted #(.IN_W(LAID_W + 1), .PLACES(DIRECTION_F + machine_pkg::REFLECT_RECIPROCAL_BITS - COORDINATE_F), .MORE_W(8),
        .W(COORDINATE_W), .S(0), .ROUND(machine_pkg::REFLECT_COORDINATE_ROUND), .WRAP(machine_pkg::REFLECT_COORDINATE_WRAP))
        layer (.exact($signed({1'b0, laid})), .more(places), .word(word));
    wire [COORDINATE_W-1:0] near = word > COORDINATE_ONE ? COORDINATE_ONE : word;
  end
  wire [COORDINATE_W-1:0] across = less[2] ? g_coordinate[0].near : COORDINATE_ONE - g_coordinate[1].near;
  wire [COORDINATE_W-1:0] down = less[2] ? g_coordinate[1].near : COORDINATE_ONE - g_coordinate[0].near;

  // Four texels, and the interpolated light between them.
  localparam int INDEX_BITS = machine_pkg::REFLECT_INDEX_BITS;
  localparam int FRACTION_W = machine_pkg::REFLECT_FRACTION_W;
  logic [3*LIGHT_W-1:0] texels[0:(1 << (2 * INDEX_BITS)) - 1];
  initial $readmemh({ROMS, "reflect.light.hex"}, texels);
  wire [INDEX_BITS-1:0] column, row;
  wire [FRACTION_W-1:0] right, below;
  reflect_step stepper_across (.coordinate(across), .less(less[0]), .index(column), .fraction(right));
  reflect_step stepper_down (.coordinate(down), .less(less[1]), .index(row), .fraction(below));
  wire [INDEX_BITS-1:0] next_column = column + INDEX_BITS'(1);
  wire [INDEX_BITS-1:0] next_row = row + INDEX_BITS'(1);
  wire [3*LIGHT_W-1:0] upper, lower, light;
  reflect_line line_above (.from(texels[{row, column}]), .to(texels[{row, next_column}]), .fraction(right), .light(upper));
  reflect_line line_below (.from(texels[{next_row, column}]), .to(texels[{next_row, next_column}]), .fraction(right), .light(lower));
  reflect_line line_down (.from(upper), .to(lower), .fraction(below), .light(light));

  // The remaining part of the colour, and the mirrored light.
  localparam int COLOUR_W = machine_pkg::SHADE_COLOUR_W;
  localparam int COLOUR_F = machine_pkg::SHADE_COLOUR_F;
  localparam int REFLECTANCE_W = machine_pkg::REFLECT_REFLECTANCE_W;
  localparam int REFLECTANCE_F = machine_pkg::REFLECT_REFLECTANCE_F;
  localparam int MORE_F = COLOUR_F > LIGHT_F ? COLOUR_F : LIGHT_F;
  localparam int MIXED_F = MORE_F + REFLECTANCE_F;
  localparam int MIXED_W = MORE_F + REFLECTANCE_W + (COLOUR_W - COLOUR_F > LIGHT_W - LIGHT_F ? COLOUR_W - COLOUR_F : LIGHT_W - LIGHT_F) + 1;
  localparam [MIXED_W-1:0] MIXED_ONE = MIXED_W'(1) << MIXED_F;
  wire [REFLECTANCE_W-1:0] kept = material[machine_pkg::MATERIAL_KEPT_LSB+:REFLECTANCE_W];
  for (genvar channel = 0; channel < 3; channel++) begin : g_channel
    wire [REFLECTANCE_W-1:0] mirrored = material[machine_pkg::MATERIAL_MIRRORED_R_LSB-channel*REFLECTANCE_W+:REFLECTANCE_W];
    wire [MIXED_W-1:0] own = MIXED_W'(colour[(2-channel)*COLOUR_W+:COLOUR_W]) * MIXED_W'(kept);
    wire [MIXED_W-1:0] seen = MIXED_W'(light[(2-channel)*LIGHT_W+:LIGHT_W]) * MIXED_W'(mirrored);
    wire [MIXED_W-1:0] both = (own << (MORE_F - COLOUR_F)) + (seen << (MORE_F - LIGHT_F));
    wire [MIXED_F:0] limited = (MIXED_F + 1)'(both > MIXED_ONE ? MIXED_ONE : both);
    fit #(.IN_W(MIXED_F + 2), .PLACES(MIXED_F - COLOUR_F), .W(COLOUR_W), .S(0), .ROUND(machine_pkg::SHADE_COLOUR_ROUND),
        .WRAP(machine_pkg::SHADE_COLOUR_WRAP)) mixer (.exact($signed({1'b0, limited})), .word(leaving[(2-channel)*COLOUR_W+:COLOUR_W]));
  end

  wire unused = &{1'b0, material};
endmodule

`default_nettype wire
