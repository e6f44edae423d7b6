// Ellipsoid: turns three principal axes into a conic, an amplitude and a box. RTL implementation of
// units/ellipse/ellipsoid.rs.
//
//   quaternion ->[ R ]-> r_i ->[ W*r ]-+-> tilt g_i ->(* s_i)-> stretch ->[ sum of s_i^2*g_i*g_i' ]-> shape -+
//                                      +-> facing c_i ->(* s_j*s_k)-> face -> area k'^2*s_j*s_k*c_i ---------+-> as for a disc
//
// Axes are the splat's own, or the frame's. The frame selects the amplitude: that of a disc, the
// integral along the ray, or the peak itself. a and b are clamped in the Jacobian only. If weights
// count by opacity alone, the box ends where no weight counts any more.
//
//   t_z ->(* 1/distance)-> share ->[ max(0, 1 - share) ]-> weight ->(* opacity)-> weighted
//
// So the opacity falls with depth, if the machine sums Gaussians with such weights.
//
// Losses: every word is rounded; the losses of shared parts are listed in their files.
`timescale 1ns / 1ps
`default_nettype none

module ellipsoid #(
    parameter int DROPS = 0, // 1: culled splats end here
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                           // clock, rising edge
    input wire rst,                                           // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,              // constants: the view, and what all ellipsoids have in common
    input wire s_valid,                                       // a splat and its point are there
    output wire s_ready,                                      // and can be taken
    input wire [TAG_W+machine_pkg::ELLIPSE_IN_W-1:0] s_data,  // the tag, ellipse.in
    output wire m_valid,                                      // an ellipse is offered
    input wire m_ready,                                       // and taken
    output wire [TAG_W+machine_pkg::ELLIPSE_OUT_W-1:0] m_data // the tag, ellipse.out
);
  localparam int RADIUS_W = machine_pkg::SPLAT_RADIUS_W;
  localparam int WORLD_W = machine_pkg::SPLAT_NORMAL_W;
  localparam int FORWARD_W = machine_pkg::PROJECT_CAMERA_W;
  localparam int INVERSE_DEPTH_BITS = machine_pkg::PROJECT_RECIPROCAL_BITS;
  localparam int SLOPE_W = machine_pkg::PROJECT_SLOPE_W;
  localparam int SLOPE_F = machine_pkg::PROJECT_SLOPE_F;
  localparam int PIXEL_W = machine_pkg::PROJECT_PIXEL_W;
  localparam int NORMAL_W = machine_pkg::ELLIPSE_NORMAL_W;
  localparam int TILT_W = machine_pkg::ELLIPSE_TILT_W;
  localparam int TILT_F = machine_pkg::ELLIPSE_TILT_F;
  localparam int FACING_W = machine_pkg::ELLIPSE_FACING_W;
  localparam int SIZE_SQUARED_W = machine_pkg::ELLIPSE_SIZE_SQUARED_W;
  localparam int SHAPE_W = machine_pkg::ELLIPSE_SHAPE_W;
  localparam int SHAPE_F = machine_pkg::ELLIPSE_SHAPE_F;
  localparam int AREA_W = machine_pkg::ELLIPSE_AREA_W;
  localparam int ROOT_BITS = machine_pkg::ELLIPSE_ROOT_BITS;
  localparam int CONIC_W = machine_pkg::ELLIPSE_CONIC_W;
  localparam int CONIC_CROSS_W = machine_pkg::ELLIPSE_CONIC_CROSS_W;
  localparam int VISIBILITY_W = machine_pkg::ELLIPSE_VISIBILITY_W;
  localparam int VISIBILITY_F = machine_pkg::ELLIPSE_VISIBILITY_F;
  localparam int INVERSE_TWO_PI_W = machine_pkg::ELLIPSE_INVERSE_TWO_PI_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int DEPTH_SLOPE_W = machine_pkg::ELLIPSE_DEPTH_SLOPE_W;
  localparam int DEPTH_RANGE_W = machine_pkg::ELLIPSE_DEPTH_RANGE_W;
  localparam int FRAGMENT_NORMAL_W = machine_pkg::FRAGMENT_NORMAL_W;
  localparam int COLUMN_W = machine_pkg::ELLIPSE_OUT_FIRST_COLUMN_W;
  localparam int WORLD_F = machine_pkg::SPLAT_NORMAL_F;
  localparam int SIZE_SQUARED_F = machine_pkg::ELLIPSE_SIZE_SQUARED_F;
  localparam int AREA_F = machine_pkg::ELLIPSE_AREA_F;
  localparam int AMPLITUDE_F = machine_pkg::ELLIPSE_AMPLITUDE_F;
  localparam int QUATERNION_W = machine_pkg::ELLIPSE_QUATERNION_W;
  localparam int QUATERNION_F = machine_pkg::ELLIPSE_QUATERNION_F;
  localparam int SCALE_W = machine_pkg::ELLIPSE_SCALE_W;
  localparam int SCALE_F = machine_pkg::ELLIPSE_SCALE_F;
  localparam int STRETCH_W = machine_pkg::ELLIPSE_STRETCH_W;
  localparam int STRETCH_F = machine_pkg::ELLIPSE_STRETCH_F;
  localparam int RAY_BITS = machine_pkg::ELLIPSE_RAY_ROOT_BITS;
  localparam int RAY_W = machine_pkg::ELLIPSE_RAY_W;
  localparam int RAY_F = machine_pkg::ELLIPSE_RAY_F;
  localparam int ALPHA_W = machine_pkg::SPLAT_OPACITY_W;
  localparam int ALPHA_F = machine_pkg::SPLAT_OPACITY_F;
  // Sums of two powers of two of 8 bits and a normaliser's shift.
  localparam int POWER_W = 10;

  // The splat and its point. Vectors are packed as in a record: (z,) y, x from the LSB on.
  wire [RADIUS_W-1:0] some_radius = s_data[machine_pkg::ELLIPSE_IN_RADIUS_LSB+:RADIUS_W];
  wire signed [FORWARD_W-1:0] forward = s_data[machine_pkg::ELLIPSE_IN_FORWARD_LSB+:FORWARD_W];
  wire signed [7:0] point_exponent = s_data[machine_pkg::ELLIPSE_IN_EXPONENT_LSB+:8];
  wire [INVERSE_DEPTH_BITS:0] inverse_depth = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_LSB+:INVERSE_DEPTH_BITS+1];
  wire signed [7:0] inverse_depth_exponent = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_EXPONENT_LSB+:8];
  wire signed [SLOPE_W-1:0] slope_x = s_data[machine_pkg::ELLIPSE_IN_SLOPE_X_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] slope_y = s_data[machine_pkg::ELLIPSE_IN_SLOPE_Y_LSB+:SLOPE_W];
  wire [ALPHA_W-1:0] opacity = s_data[machine_pkg::ELLIPSE_IN_OPACITY_LSB+:ALPHA_W];
  wire own_axes = frame[machine_pkg::FRAME_OWN_AXES_LSB];
  // Kind of the amplitude: 0 that of a disc, 1 the integral along the ray, 2 the peak.
  wire [1:0] kind = frame[machine_pkg::FRAME_AMPLITUDE_LSB+:2];
  wire flattened = kind == 2'd0;

  // The columns of a quaternion's rotation, in world space, with the first component in the most
  // significant bits.
  localparam int TURNED_W = 2 * QUATERNION_W + 4 > 2 * QUATERNION_F + 3 ? 2 * QUATERNION_W + 4 : 2 * QUATERNION_F + 3;
  localparam [TURNED_W-1:0] ONE = TURNED_W'(1) << (2 * QUATERNION_F);
  wire signed [QUATERNION_W-1:0] w = s_data[machine_pkg::ELLIPSE_IN_QUATERNION_W_LSB+:QUATERNION_W];
  wire signed [QUATERNION_W-1:0] x = s_data[machine_pkg::ELLIPSE_IN_QUATERNION_X_LSB+:QUATERNION_W];
  wire signed [QUATERNION_W-1:0] y = s_data[machine_pkg::ELLIPSE_IN_QUATERNION_Y_LSB+:QUATERNION_W];
  wire signed [QUATERNION_W-1:0] z = s_data[machine_pkg::ELLIPSE_IN_QUATERNION_Z_LSB+:QUATERNION_W];
  wire signed [TURNED_W-1:0] xx = x * x, yy = y * y, zz = z * z, xy = x * y, xz = x * z, yz = y * z, wx = w * x, wy = w * y, wz = w * z;
  wire signed [TURNED_W-1:0] one = $signed(ONE);
  wire [9*TURNED_W-1:0] columns = {
    one - ((yy + zz) <<< 1), (xy + wz) <<< 1, (xz - wy) <<< 1,
    (xy - wz) <<< 1, one - ((xx + zz) <<< 1), (yz + wx) <<< 1,
    (xz + wy) <<< 1, (yz - wx) <<< 1, one - ((xx + yy) <<< 1)
  };
  wire [9*WORLD_W-1:0] directions;
  for (genvar part = 0; part < 9; part++) begin : g_rotation
    wire signed [TURNED_W-1:0] column = columns[part*TURNED_W+:TURNED_W];
    fit #(.IN_W(TURNED_W), .PLACES(2 * QUATERNION_F - WORLD_F), .W(WORLD_W), .S(1), .ROUND(machine_pkg::ELLIPSE_ROTATION_ROUND),
        .WRAP(machine_pkg::ELLIPSE_ROTATION_WRAP)) fit_rotation (.exact(column), .word(directions[part*WORLD_W+:WORLD_W]));
  end

  // In the Jacobian slopes are clamped.
  wire signed [SLOPE_W-1:0] limit_x = frame[machine_pkg::FRAME_JACOBIAN_X_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] limit_y = frame[machine_pkg::FRAME_JACOBIAN_Y_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] below_x = slope_x < limit_x ? slope_x : limit_x, below_y = slope_y < limit_y ? slope_y : limit_y;
  wire signed [SLOPE_W-1:0] a = below_x > -limit_x ? below_x : -limit_x, b = below_y > -limit_y ? below_y : -limit_y;

  // Each axis, the third in the low bits: its direction, its inclination to the ray, its projection
  // on the screen.
  wire [3*SCALE_W-1:0] scales =
      own_axes ? s_data[machine_pkg::ELLIPSE_IN_SCALE_2_LSB+:3*SCALE_W] : frame[machine_pkg::FRAME_SCALE_2_LSB+:3*SCALE_W];
  localparam int SQUARES_W = 2 * STRETCH_W + 2;
  wire signed [FACING_W-1:0] some_facing;
  wire signed [NORMAL_W-1:0] axis_x, axis_y;
  wire [3*FACING_W-1:0] faces;
  for (genvar axis = 0; axis < 3; axis++) begin : g_axis
    localparam int LAST = (axis + 1) % 3;
    localparam int NEXT = (axis + 2) % 3;
    wire [3*NORMAL_W-1:0] own_direction;
    ellipse_normal turn_axis (.frame(frame), .vector(directions[axis*3*WORLD_W+:3*WORLD_W]), .normal(own_direction));
    wire [3*NORMAL_W-1:0] direction =
        own_axes ? own_direction : frame[machine_pkg::FRAME_AXIS_2_Z_LSB+axis*3*NORMAL_W+:3*NORMAL_W];
    wire signed [TILT_W-1:0] tilt_x, tilt_y;
    wire signed [FACING_W-1:0] facing;
    ellipse_turn turn (.a(a), .b(b), .normal(direction), .tilt_x(tilt_x), .tilt_y(tilt_y), .facing(facing));

    wire [SCALE_W-1:0] scale = scales[axis*SCALE_W+:SCALE_W];
    wire signed [SCALE_W+TILT_W:0] stretched_x = $signed({1'b0, scale}) * tilt_x, stretched_y = $signed({1'b0, scale}) * tilt_y;
    wire signed [STRETCH_W-1:0] stretch_x, stretch_y;
    fit #(.IN_W(SCALE_W + TILT_W + 1), .PLACES(SCALE_F + TILT_F - STRETCH_F), .W(STRETCH_W), .S(1),
        .ROUND(machine_pkg::ELLIPSE_STRETCH_ROUND), .WRAP(machine_pkg::ELLIPSE_STRETCH_WRAP))
        fit_stretch_x (.exact(stretched_x), .word(stretch_x));
    fit #(.IN_W(SCALE_W + TILT_W + 1), .PLACES(SCALE_F + TILT_F - STRETCH_F), .W(STRETCH_W), .S(1),
        .ROUND(machine_pkg::ELLIPSE_STRETCH_ROUND), .WRAP(machine_pkg::ELLIPSE_STRETCH_WRAP))
        fit_stretch_y (.exact(stretched_y), .word(stretch_y));
    wire signed [SQUARES_W-1:0] square_xx = stretch_x * stretch_x, square_xy = stretch_x * stretch_y, square_yy = stretch_y * stretch_y;

    // The face spanned by the two other axes.
    wire signed [2*SCALE_W:0] paired = $signed({1'b0, scales[LAST*SCALE_W+:SCALE_W]}) * $signed({1'b0, scales[NEXT*SCALE_W+:SCALE_W]});
    wire [SCALE_W-1:0] pair;
    fit #(.IN_W(2 * SCALE_W + 1), .PLACES(SCALE_F), .W(SCALE_W), .S(0), .ROUND(machine_pkg::ELLIPSE_SCALE_ROUND),
        .WRAP(machine_pkg::ELLIPSE_SCALE_WRAP)) fit_pair (.exact(paired), .word(pair));
    wire signed [SCALE_W+FACING_W:0] faced = $signed({1'b0, pair}) * facing;
    fit #(.IN_W(SCALE_W + FACING_W + 1), .PLACES(SCALE_F), .W(FACING_W), .S(1), .ROUND(machine_pkg::ELLIPSE_FACE_ROUND),
        .WRAP(machine_pkg::ELLIPSE_FACE_WRAP)) fit_face (.exact(faced), .word(faces[axis*FACING_W+:FACING_W]));
  end
  assign some_facing = g_axis[0].facing;
  assign axis_x = g_axis[0].direction[2*NORMAL_W+:NORMAL_W];
  assign axis_y = g_axis[0].direction[NORMAL_W+:NORMAL_W];
  wire signed [SQUARES_W-1:0] shaped_xx = g_axis[2].square_xx + g_axis[1].square_xx + g_axis[0].square_xx;
  wire signed [SQUARES_W-1:0] shaped_xy = g_axis[2].square_xy + g_axis[1].square_xy + g_axis[0].square_xy;
  wire signed [SQUARES_W-1:0] shaped_yy = g_axis[2].square_yy + g_axis[1].square_yy + g_axis[0].square_yy;
  wire signed [SHAPE_W-1:0] shape_xx, shape_xy, shape_yy;
  fit #(.IN_W(SQUARES_W), .PLACES(2 * STRETCH_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_xx (.exact(shaped_xx), .word(shape_xx));
  fit #(.IN_W(SQUARES_W), .PLACES(2 * STRETCH_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_xy (.exact(shaped_xy), .word(shape_xy));
  fit #(.IN_W(SQUARES_W), .PLACES(2 * STRETCH_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_yy (.exact(shaped_yy), .word(shape_yy));

  // Where weights fall with depth, so does the opacity of a peak.
  localparam int SHARE_W = machine_pkg::VIEW_SHARE_W;
  wire [ALPHA_W-1:0] weighted;
  if (SHARE_W > 0) begin : g_depth_weight
    localparam int SHARE_F = machine_pkg::VIEW_SHARE_F;
    localparam int WEIGHT_W = machine_pkg::VIEW_WEIGHT_W;
    localparam int WEIGHT_F = machine_pkg::VIEW_WEIGHT_F;
    localparam int PRODUCT_W = FORWARD_W + SHARE_W + 1;
    localparam [SHARE_W:0] WHOLE = (SHARE_W + 1)'(1) << SHARE_F;
    wire [SHARE_W-1:0] inverse_distance = frame[machine_pkg::VIEW_INVERSE_DISTANCE_LSB+:SHARE_W];
    wire signed [7:0] places = frame[machine_pkg::VIEW_INVERSE_DISTANCE_PLACES_LSB+:8];
    wire signed [8:0] share_more = 9'(places) - 9'(point_exponent);
    wire signed [PRODUCT_W-1:0] product = forward * $signed({1'b0, inverse_distance});
    wire [SHARE_W-1:0] share;
    fit_shifted #(.IN_W(PRODUCT_W), .PLACES(machine_pkg::PROJECT_CAMERA_F), .MORE_W(9), .W(SHARE_W), .S(0),
        .ROUND(machine_pkg::VIEW_SHARE_ROUND), .WRAP(0)) fit_share (.exact(product), .more(share_more), .word(share));
    wire [SHARE_W:0] rest = {1'b0, share} > WHOLE ? '0 : WHOLE - {1'b0, share};
    wire [WEIGHT_W-1:0] weight;
    fit #(.IN_W(SHARE_W + 2), .PLACES(SHARE_F - WEIGHT_F), .W(WEIGHT_W), .S(0), .ROUND(machine_pkg::VIEW_WEIGHT_ROUND), .WRAP(0))
        fit_weight (.exact($signed({1'b0, rest})), .word(weight));
    wire signed [ALPHA_W+WEIGHT_W:0] reduced = $signed({1'b0, opacity}) * $signed({1'b0, weight});
    wire [ALPHA_W-1:0] fainter;
    fit #(.IN_W(ALPHA_W + WEIGHT_W + 1), .PLACES(WEIGHT_F), .W(ALPHA_W), .S(0), .ROUND(machine_pkg::SPLAT_OPACITY_ROUND),
        .WRAP(machine_pkg::SPLAT_OPACITY_WRAP)) fit_weighted (.exact(reduced), .word(fainter));
    assign weighted = kind[1] ? fainter : opacity;
  end else begin : g_same_weights
    assign weighted = opacity;
  end

  wire backface = frame[machine_pkg::FRAME_CULL_BACKFACES_LSB] && some_facing > FACING_W'(0);
  wire blind = some_radius == '0 || (flattened ? some_facing == '0 : weighted == '0);
  // Divisors are never 0, also for culled splats.
  wire signed [FACING_W-1:0] facing = some_facing == '0 ? FACING_W'(1) : some_facing;
  wire [RADIUS_W-1:0] radius = some_radius == '0 ? RADIUS_W'(1) : some_radius;

  wire [3*SIZE_SQUARED_W-1:0] sizes_squared;
  wire signed [POWER_W-1:0] exponent;
  ellipse_size #(.POWER_W(POWER_W)) sizer (.frame(frame), .radius(radius), .point_exponent(point_exponent), .inverse_depth(inverse_depth),
      .inverse_depth_exponent(inverse_depth_exponent), .sizes_squared(sizes_squared), .exponent(exponent));

  // No weight counts beyond a radial index that depends on the opacity: the box ends there, by a
  // table, or at the frame's cutoff.
  localparam int CUTOFF_W = machine_pkg::RASTER_CUTOFF_W;
  localparam int REACH_BITS = machine_pkg::ELLIPSE_REACH_BITS;
  wire [CUTOFF_W-1:0] cutoff;
  if (REACH_BITS > 0) begin : g_reach
    logic [CUTOFF_W-1:0] cutoffs[0:2**REACH_BITS-1];
    initial $readmemh({ROMS, "ellipse.reach.hex"}, cutoffs);
    // An opacity of 1 uses the last address.
    wire [ALPHA_W-1:0] step = opacity >> (ALPHA_F - REACH_BITS);
    wire [REACH_BITS-1:0] address = |(step >> REACH_BITS) ? {REACH_BITS{1'b1}} : REACH_BITS'(step);
    assign cutoff = cutoffs[address];
  end else begin : g_no_reach
    assign cutoff = frame[machine_pkg::FRAME_CUTOFF_LSB+:CUTOFF_W];
  end

  wire [3*AREA_W-1:0] areas;
  wire [ROOT_BITS:0] root;
  wire signed [7:0] root_exponent;
  wire flat, missed;
  wire [CONIC_W-1:0] conic_xx, conic_yy;
  wire [CONIC_CROSS_W-1:0] conic_xy;
  wire [2*COLUMN_W-1:0] firsts, lasts;
  ellipse_footprint #(.FACES(3), .POWER_W(POWER_W), .ROMS(ROMS)) footprint (.frame(frame), .cutoff(cutoff),
      .pixels_from_middle(s_data[machine_pkg::ELLIPSE_IN_PIXEL_Y_LSB+:2*PIXEL_W]), .sizes_squared(sizes_squared), .exponent(exponent),
      .shape_xx(shape_xx), .shape_xy(shape_xy), .shape_yy(shape_yy), .faces(faces), .areas(areas), .root(root),
      .root_exponent(root_exponent), .flat(flat), .conic_xx(conic_xx), .conic_xy(conic_xy), .conic_yy(conic_yy), .firsts(firsts),
      .lasts(lasts), .outside(missed));

  // Length of the ray per unit of depth: |(a, b, 1)|.
  localparam int LENGTH_W = (2 * SLOPE_W > 2 * SLOPE_F + 1 ? 2 * SLOPE_W : 2 * SLOPE_F + 1) + 2;
  localparam int RAYED_W = 2 * RAY_BITS + 3;
  wire signed [LENGTH_W-1:0] aa = a * a, bb = b * b;
  wire [LENGTH_W-1:0] length_squared = aa + bb + (LENGTH_W'(1) << (2 * SLOPE_F));
  wire [RAY_BITS:0] ray_operand, ray_root;
  wire signed [7:0] ray_exponent;
  reciprocal_root #(.IN_W(LENGTH_W), .IN_F(2 * SLOPE_F), .BITS(RAY_BITS), .TABLE_BITS(machine_pkg::ELLIPSE_RAY_ROOT_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::ELLIPSE_RAY_ROOT_NEWTON_STEPS), .ROM({ROMS, "ellipse.ray_root.hex"}))
      ray_rooter (.x(length_squared), .operand(ray_operand), .mantissa(ray_root), .exponent(ray_exponent));
  wire signed [RAYED_W-1:0] rayed = $signed({1'b0, ray_operand}) * $signed({1'b0, ray_root});
  wire [RAY_W-1:0] ray;
  fit_shifted #(.IN_W(RAYED_W), .PLACES(2 * RAY_BITS - 1 - RAY_F), .MORE_W(9), .W(RAY_W), .S(0), .ROUND(machine_pkg::ELLIPSE_RAY_ROUND),
      .WRAP(machine_pkg::ELLIPSE_RAY_WRAP)) fit_ray (.exact(rayed), .more(9'(ray_exponent)), .word(ray));
  wire signed [SIZE_SQUARED_W+RAY_W:0] thick = $signed({1'b0, sizes_squared[SIZE_SQUARED_W+:SIZE_SQUARED_W]}) * $signed({1'b0, ray});
  wire signed [AREA_W-1:0] along;
  fit #(.IN_W(SIZE_SQUARED_W + RAY_W + 1), .PLACES(SIZE_SQUARED_F + RAY_F - AREA_F), .W(AREA_W), .S(1),
      .ROUND(machine_pkg::ELLIPSE_AREA_ROUND), .WRAP(machine_pkg::ELLIPSE_AREA_WRAP)) fit_along (.exact(thick), .word(along));

  // The sum over the faces: the root of det V_r', if opacities are compensated.
  localparam int COMPENSATION_BITS = machine_pkg::ELLIPSE_COMPENSATION_ROOT_BITS;
  wire signed [AREA_W-1:0] spanned;
  if (COMPENSATION_BITS > 0) begin : g_compensation
    localparam int SPANNED_W = 2 * COMPENSATION_BITS + 3;
    wire signed [AREA_W-1:0] area_0 = areas[2*AREA_W+:AREA_W], area_1 = areas[AREA_W+:AREA_W], area_2 = areas[0+:AREA_W];
    wire signed [2*AREA_W+1:0] square_0 = area_0 * area_0, square_1 = area_1 * area_1, square_2 = area_2 * area_2;
    wire [2*AREA_W+1:0] some_squares = square_0 + square_1 + square_2;
    wire [2*AREA_W+1:0] squares = some_squares == '0 ? (2 * AREA_W + 2)'(1) : some_squares;
    wire [COMPENSATION_BITS:0] squares_operand, squares_root;
    wire signed [7:0] squares_exponent;
    reciprocal_root #(.IN_W(2 * AREA_W + 2), .IN_F(2 * AREA_F), .BITS(COMPENSATION_BITS),
        .TABLE_BITS(machine_pkg::ELLIPSE_COMPENSATION_ROOT_TABLE_BITS), .NEWTON_STEPS(machine_pkg::ELLIPSE_COMPENSATION_ROOT_NEWTON_STEPS),
        .ROM({ROMS, "ellipse.compensation_root.hex"}))
        rooter (.x(squares), .operand(squares_operand), .mantissa(squares_root), .exponent(squares_exponent));
    wire signed [SPANNED_W-1:0] rooted = $signed({1'b0, squares_operand}) * $signed({1'b0, squares_root});
    fit_shifted #(.IN_W(SPANNED_W), .PLACES(2 * COMPENSATION_BITS - 1 - AREA_F), .MORE_W(9), .W(AREA_W), .S(1),
        .ROUND(machine_pkg::ELLIPSE_AREA_ROUND), .WRAP(machine_pkg::ELLIPSE_AREA_WRAP))
        fit_spanned (.exact(rooted), .more(9'(squares_exponent)), .word(spanned));
  end else begin : g_no_compensation
    assign spanned = AREA_W'(0);
  end

  // Amplitude.
  wire [VISIBILITY_W-1:0] visibility;
  wire signed [AREA_W-1:0] seen = flattened ? $signed(areas[0+:AREA_W]) : kind == 2'd3 ? spanned : along;
  ellipse_visibility show (.area(seen), .root(root), .root_exponent(root_exponent), .visibility(visibility));
  wire [INVERSE_TWO_PI_W-1:0] inverse_two_pi = INVERSE_TWO_PI_W'(machine_pkg::ELLIPSE_INVERSE_TWO_PI_WORD);
  wire signed [VISIBILITY_W+INVERSE_TWO_PI_W:0] shown = $signed({1'b0, visibility}) * $signed({1'b0, inverse_two_pi});
  wire [AMPLITUDE_W-1:0] of_disc;
  fit #(.IN_W(VISIBILITY_W + INVERSE_TWO_PI_W + 1),
      .PLACES(VISIBILITY_F + machine_pkg::ELLIPSE_INVERSE_TWO_PI_F - machine_pkg::ELLIPSE_AMPLITUDE_F), .W(AMPLITUDE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_AMPLITUDE_ROUND), .WRAP(machine_pkg::ELLIPSE_AMPLITUDE_WRAP))
      fit_amplitude (.exact(shown), .word(of_disc));
  wire signed [VISIBILITY_W+ALPHA_W:0] weighed = $signed({1'b0, visibility}) * $signed({1'b0, weighted});
  wire [AMPLITUDE_W-1:0] of_ray, of_peak;
  fit #(.IN_W(VISIBILITY_W + ALPHA_W + 1), .PLACES(VISIBILITY_F + ALPHA_F - AMPLITUDE_F), .W(AMPLITUDE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_AMPLITUDE_ROUND), .WRAP(machine_pkg::ELLIPSE_AMPLITUDE_WRAP))
      fit_weighed (.exact(weighed), .word(of_ray));
  fit #(.IN_W(ALPHA_W + 1), .PLACES(ALPHA_F - AMPLITUDE_F), .W(AMPLITUDE_W), .S(0), .ROUND(machine_pkg::ELLIPSE_AMPLITUDE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_AMPLITUDE_WRAP)) fit_peak (.exact($signed({1'b0, weighted})), .word(of_peak));
  wire [AMPLITUDE_W-1:0] amplitude = flattened ? of_disc : kind == 2'd2 ? of_peak : of_ray;
  wire dark = amplitude == '0;

  // The normal in camera space.
  wire [3*NORMAL_W-1:0] normal;
  ellipse_normal turn_normal (.frame(frame), .vector(s_data[machine_pkg::ELLIPSE_IN_NORMAL_Z_LSB+:3*WORLD_W]), .normal(normal));
  wire [3*FRAGMENT_NORMAL_W-1:0] fragment_normal;
  // Turned towards the viewer, where n_z > 0; the smallest word has no negative among the words.
  localparam int SEEN_W = NORMAL_W + 1;
  wire away = machine_pkg::FRAGMENT_TURN_NORMALS != 0 && $signed(normal[0+:NORMAL_W]) > NORMAL_W'(0);
  for (genvar i = 0; i < 3; i++) begin : g_normal
    wire signed [NORMAL_W-1:0] own = normal[i*NORMAL_W+:NORMAL_W];
    wire signed [SEEN_W-1:0] part = away ? -(SEEN_W'(own)) : SEEN_W'(own);
    fit #(.IN_W(SEEN_W), .PLACES(machine_pkg::ELLIPSE_NORMAL_F - machine_pkg::FRAGMENT_NORMAL_F), .W(FRAGMENT_NORMAL_W), .S(1),
        .ROUND(machine_pkg::FRAGMENT_NORMAL_ROUND), .WRAP(machine_pkg::FRAGMENT_NORMAL_WRAP))
        fit_fragment_normal (.exact(part), .word(fragment_normal[i*FRAGMENT_NORMAL_W+:FRAGMENT_NORMAL_W]));
  end

  // The depth plane: only of flat splats.
  wire [DEPTH_SLOPE_W-1:0] depth_slope_x, depth_slope_y;
  wire [DEPTH_RANGE_W-1:0] depth_range;
  ellipse_plane #(.POWER_W(POWER_W), .ROMS(ROMS)) plane (.frame(frame), .radius(radius), .forward(forward), .point_exponent(point_exponent),
      .facing(facing), .normal_x(axis_x), .normal_y(axis_y), .depth_slope_x(depth_slope_x), .depth_slope_y(depth_slope_y),
      .depth_range(depth_range));
  localparam int PLANE_W = 2 * DEPTH_SLOPE_W + DEPTH_RANGE_W;
  wire [PLANE_W-1:0] tilted = flattened ? {depth_slope_x, depth_slope_y, depth_range} : PLANE_W'(0);

  // The first cull reason that holds.
  wire faint = !backface && (blind || flat || dark);
  wire outside = !backface && !faint && missed;
  wire [machine_pkg::ELLIPSE_OUT_W-4:0] drawn = {fragment_normal, conic_xx, conic_xy, conic_yy, amplitude, firsts[COLUMN_W+:COLUMN_W],
      lasts[COLUMN_W+:COLUMN_W], firsts[0+:COLUMN_W], lasts[0+:COLUMN_W], tilted};
  wire [machine_pkg::ELLIPSE_OUT_W-1:0] result = {backface, faint, outside, backface || faint || outside ? '0 : drawn};
  // The frame also has constants for other units; one more face is used for a disc.
  wire unused = &{1'b0, frame, areas};

  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::ELLIPSE_OUT_W;
  wire keeps = DROPS == 0 || !(backface || faint || outside);
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::ELLIPSE_IN_W, result});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::ELLIPSE_LATENCY), .INTERVAL(machine_pkg::ELLIPSE_INTERVAL), .ROOM(machine_pkg::ELLIPSE_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(keeps), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
