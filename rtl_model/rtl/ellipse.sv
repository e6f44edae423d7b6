// Ellipse: turns a normal and a radius into a conic, an amplitude, a box and a depth plane. Twin of units/ellipse.rs.
//
//   radius ->(* focal)->(* 1/t_z)-> size k' = k/2^e ---> k'^2 -+------------------------>(*)-> variance V' -+-> extent -> box
//   normal ->[ W*n ]-+-> tilt g ->[ 1+a^2 .. - gg' ]-> shape --+     low_pass v/4^e -----(+)--+             |
//                    +-> facing c_n -> area k'^2*c_n -> determinant ->[ 1/sqrt ]-+-> inverse ->(*)----------+-> conic
//                          +->[ 1/|c_n| ]-> depth_slope                          +-> visibility -> amplitude
//
// Each splat works relative to a power of two 2^e near its own radius in pixels, so small and large footprints keep the same precision.
//
// Losses: every word is rounded, but scaled_radius, which a normaliser cuts; extent gets one more place than it needs, so the box never
// loses a pixel; depth_slope is limited, for a grazing plane's slope has no limit.
`default_nettype none

module ellipse (
    input wire clk,                                      // everything happens at its rising edge
    input wire rst,                                      // forgets what is under way
    input wire [machine_pkg::FRAME_W-1:0] frame,         // constants: the view
    input wire s_valid,                                  // a splat and its point are there
    output wire s_ready,                                 // and can be taken
    input wire [machine_pkg::ELLIPSE_IN_W-1:0] s_data,   // ellipse.in
    output wire m_valid,                                 // an ellipse is offered
    input wire m_ready,                                  // and taken
    output wire [machine_pkg::ELLIPSE_OUT_W-1:0] m_data  // ellipse.out
);
  localparam int RADIUS_W = machine_pkg::SPLAT_RADIUS_W;
  localparam int WORLD_W = machine_pkg::SPLAT_NORMAL_W;
  localparam int ROTATION_W = machine_pkg::PROJECT_ROTATION_W;
  localparam int FORWARD_W = machine_pkg::PROJECT_CAMERA_W;
  localparam int INVERSE_DEPTH_BITS = machine_pkg::PROJECT_RECIPROCAL_BITS;
  localparam int SLOPE_W = machine_pkg::PROJECT_SLOPE_W;
  localparam int SLOPE_F = machine_pkg::PROJECT_SLOPE_F;
  localparam int FOCAL_W = machine_pkg::PROJECT_FOCAL_W;
  localparam int PIXEL_W = machine_pkg::PROJECT_PIXEL_W;
  localparam int PIXEL_F = machine_pkg::PROJECT_PIXEL_F;
  localparam int NORMAL_W = machine_pkg::ELLIPSE_NORMAL_W;
  localparam int NORMAL_F = machine_pkg::ELLIPSE_NORMAL_F;
  localparam int TILT_W = machine_pkg::ELLIPSE_TILT_W;
  localparam int TILT_F = machine_pkg::ELLIPSE_TILT_F;
  localparam int FACING_W = machine_pkg::ELLIPSE_FACING_W;
  localparam int FACING_F = machine_pkg::ELLIPSE_FACING_F;
  localparam int SCALED_RADIUS_W = machine_pkg::ELLIPSE_SCALED_RADIUS_W;
  localparam int SCALED_RADIUS_F = machine_pkg::ELLIPSE_SCALED_RADIUS_F;
  localparam int SIZE_W = machine_pkg::ELLIPSE_SIZE_W;
  localparam int SIZE_F = machine_pkg::ELLIPSE_SIZE_F;
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
  localparam int VISIBILITY_W = machine_pkg::ELLIPSE_VISIBILITY_W;
  localparam int VISIBILITY_F = machine_pkg::ELLIPSE_VISIBILITY_F;
  localparam int INVERSE_TWO_PI_W = machine_pkg::ELLIPSE_INVERSE_TWO_PI_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int CUTOFF_W = machine_pkg::RASTER_CUTOFF_W;
  localparam int EXTENT_BITS = machine_pkg::ELLIPSE_EXTENT_ROOT_BITS;
  localparam int EXTENT_W = machine_pkg::ELLIPSE_EXTENT_W;
  localparam int EXTENT_F = machine_pkg::ELLIPSE_EXTENT_F;
  localparam int STEEP_BITS = machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_BITS;
  localparam int INVERSE_FOCAL_W = machine_pkg::ELLIPSE_INVERSE_FOCAL_W;
  localparam int STEP_W = machine_pkg::ELLIPSE_DEPTH_STEP_W;
  localparam int STEP_F = machine_pkg::ELLIPSE_DEPTH_STEP_F;
  localparam int DEPTH_SLOPE_W = machine_pkg::ELLIPSE_DEPTH_SLOPE_W;
  localparam int ROOT_CUTOFF_W = machine_pkg::ELLIPSE_ROOT_CUTOFF_W;
  localparam int DEPTH_RANGE_W = machine_pkg::ELLIPSE_DEPTH_RANGE_W;
  localparam int FRAGMENT_NORMAL_W = machine_pkg::FRAGMENT_NORMAL_W;
  localparam int COLUMN_W = machine_pkg::ELLIPSE_OUT_FIRST_COLUMN_W;
  localparam int PIXELS_W = machine_pkg::FRAME_WIDTH_W;
  // Sums of two powers of two of 8 bits and a normaliser's places.
  localparam int POWER_W = 10;
  // An edge of the box, whole pixels: a picture has up to 16384.
  localparam int EDGE_W = 17;

  // The splat and its point. Vectors lie as in a record: (z,) y, x from the last place on.
  wire [RADIUS_W-1:0] some_radius = s_data[machine_pkg::ELLIPSE_IN_RADIUS_LSB+:RADIUS_W];
  wire signed [FORWARD_W-1:0] forward = s_data[machine_pkg::ELLIPSE_IN_FORWARD_LSB+:FORWARD_W];
  wire signed [7:0] point_exponent = s_data[machine_pkg::ELLIPSE_IN_EXPONENT_LSB+:8];
  wire [INVERSE_DEPTH_BITS:0] inverse_depth = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_LSB+:INVERSE_DEPTH_BITS+1];
  wire signed [7:0] inverse_depth_exponent = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_EXPONENT_LSB+:8];
  wire signed [SLOPE_W-1:0] a = s_data[machine_pkg::ELLIPSE_IN_SLOPE_X_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] b = s_data[machine_pkg::ELLIPSE_IN_SLOPE_Y_LSB+:SLOPE_W];

  // The normal in camera space.
  wire [3*NORMAL_W-1:0] normal;
  wire [3*FRAGMENT_NORMAL_W-1:0] fragment_normal;
  for (genvar i = 0; i < 3; i++) begin : g_normal
    wire signed [ROTATION_W+WORLD_W:0] rotated;
    wire signed [NORMAL_W-1:0] part;
    dot #(.A_W(ROTATION_W), .B_W(WORLD_W)) rotate (.a(frame[machine_pkg::FRAME_ROTATION_22_LSB+i*3*ROTATION_W+:3*ROTATION_W]),
        .b(s_data[machine_pkg::ELLIPSE_IN_NORMAL_Z_LSB+:3*WORLD_W]), .sum(rotated));
    fit #(.IN_W(ROTATION_W + WORLD_W + 1), .PLACES(machine_pkg::PROJECT_ROTATION_F + machine_pkg::SPLAT_NORMAL_F - NORMAL_F), .W(NORMAL_W),
        .S(1), .ROUND(machine_pkg::ELLIPSE_NORMAL_ROUND), .WRAP(machine_pkg::ELLIPSE_NORMAL_WRAP))
        fit_normal (.exact(rotated), .word(part));
    fit #(.IN_W(NORMAL_W), .PLACES(NORMAL_F - machine_pkg::FRAGMENT_NORMAL_F), .W(FRAGMENT_NORMAL_W), .S(1),
        .ROUND(machine_pkg::FRAGMENT_NORMAL_ROUND), .WRAP(machine_pkg::FRAGMENT_NORMAL_WRAP))
        fit_fragment_normal (.exact(part), .word(fragment_normal[i*FRAGMENT_NORMAL_W+:FRAGMENT_NORMAL_W]));
    assign normal[i*NORMAL_W+:NORMAL_W] = part;
  end
  wire signed [NORMAL_W-1:0] normal_x = normal[2*NORMAL_W+:NORMAL_W];
  wire signed [NORMAL_W-1:0] normal_y = normal[NORMAL_W+:NORMAL_W];
  wire signed [NORMAL_W-1:0] normal_z = normal[0+:NORMAL_W];

  // How the splat leans against its ray: tilt g, and facing c_n.
  localparam int LEANED_F = SLOPE_F + NORMAL_F;
  localparam int LEANED_W = (SLOPE_W > SLOPE_F ? SLOPE_W : SLOPE_F) + NORMAL_W + 2;
  wire signed [LEANED_W-1:0] a_x = a * normal_x, a_z = a * normal_z, b_y = b * normal_y, b_z = b * normal_z;
  wire signed [LEANED_W-1:0] x = LEANED_W'(normal_x) <<< SLOPE_F, y = LEANED_W'(normal_y) <<< SLOPE_F;
  wire signed [LEANED_W-1:0] z = LEANED_W'(normal_z) <<< SLOPE_F;
  wire signed [LEANED_W-1:0] leaned_x = x - a_z, leaned_y = y - b_z, faced = a_x + b_y + z;
  wire signed [TILT_W-1:0] tilt_x, tilt_y;
  wire signed [FACING_W-1:0] some_facing;
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - TILT_F), .W(TILT_W), .S(1), .ROUND(machine_pkg::ELLIPSE_TILT_ROUND),
      .WRAP(machine_pkg::ELLIPSE_TILT_WRAP)) fit_tilt_x (.exact(leaned_x), .word(tilt_x));
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - TILT_F), .W(TILT_W), .S(1), .ROUND(machine_pkg::ELLIPSE_TILT_ROUND),
      .WRAP(machine_pkg::ELLIPSE_TILT_WRAP)) fit_tilt_y (.exact(leaned_y), .word(tilt_y));
  fit #(.IN_W(LEANED_W), .PLACES(LEANED_F - FACING_F), .W(FACING_W), .S(1), .ROUND(machine_pkg::ELLIPSE_FACING_ROUND),
      .WRAP(machine_pkg::ELLIPSE_FACING_WRAP)) fit_facing (.exact(faced), .word(some_facing));

  wire backface = frame[machine_pkg::FRAME_CULL_BACKFACES_LSB] && some_facing > FACING_W'(0);
  wire blind = some_facing == '0 || some_radius == '0;
  // What is divided by is never 0, whatever becomes of the splat.
  wire signed [FACING_W-1:0] facing = blind ? FACING_W'(1) : some_facing;
  wire [RADIUS_W-1:0] radius = some_radius == '0 ? RADIUS_W'(1) : some_radius;

  // Size k' = k/2^e, and e: k = scaled_radius * inverse_depth * 2^power, where the product lies in [1/2, 2].
  localparam int SCALED_W = FOCAL_W + RADIUS_W;
  localparam int SCALED_F = machine_pkg::PROJECT_FOCAL_F + machine_pkg::SPLAT_RADIUS_F;
  localparam int SIZED_W = SCALED_RADIUS_W + INVERSE_DEPTH_BITS + 2;
  wire [SCALED_W-1:0] some_scaled = frame[machine_pkg::FRAME_FOCAL_LSB+:FOCAL_W] * radius;
  wire [SCALED_W-1:0] scaled = some_scaled == '0 ? SCALED_W'(1) : some_scaled;
  wire [SCALED_W-1:0] normalised;
  wire signed [7:0] lead;
  normalise #(.W(SCALED_W)) normaliser (.value(scaled), .normalised(normalised), .lead(lead));
  wire signed [SCALED_W:0] top = {1'b0, normalised};
  wire [SCALED_RADIUS_W-1:0] scaled_radius;
  fit #(.IN_W(SCALED_W + 1), .PLACES(SCALED_W - 1 - SCALED_RADIUS_F), .W(SCALED_RADIUS_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_SCALED_RADIUS_ROUND), .WRAP(machine_pkg::ELLIPSE_SCALED_RADIUS_WRAP))
      fit_scaled_radius (.exact(top), .word(scaled_radius));

  wire signed [POWER_W-1:0] power =
      POWER_W'(inverse_depth_exponent) - POWER_W'(point_exponent) + POWER_W'(SCALED_W - 1 - SCALED_F) - POWER_W'(lead);
  wire signed [POWER_W-1:0] exponent = power < POWER_W'(0) ? POWER_W'(0) : power + POWER_W'(1);
  wire signed [POWER_W-1:0] size_more = exponent - power;
  wire signed [SIZED_W-1:0] sized = $signed({1'b0, scaled_radius}) * $signed({1'b0, inverse_depth});
  wire [SIZE_W-1:0] size;
  fit_shifted #(.IN_W(SIZED_W), .PLACES(SCALED_RADIUS_F + INVERSE_DEPTH_BITS - SIZE_F), .MORE_W(POWER_W), .W(SIZE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_SIZE_ROUND), .WRAP(machine_pkg::ELLIPSE_SIZE_WRAP))
      fit_size (.exact(sized), .more(size_more), .word(size));
  wire signed [2*SIZE_W:0] squared = $signed({1'b0, size}) * $signed({1'b0, size});
  wire [SIZE_SQUARED_W-1:0] size_squared;
  fit #(.IN_W(2 * SIZE_W + 1), .PLACES(2 * SIZE_F - SIZE_SQUARED_F), .W(SIZE_SQUARED_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_SIZE_SQUARED_ROUND), .WRAP(machine_pkg::ELLIPSE_SIZE_SQUARED_WRAP))
      fit_size_squared (.exact(squared), .word(size_squared));

  wire signed [LOW_PASS_W:0] filter = {1'b0, frame[machine_pkg::FRAME_LOW_PASS_LSB+:LOW_PASS_W]};
  wire signed [POWER_W:0] twice_exponent = {exponent, 1'b0};
  wire [LOW_PASS_W-1:0] low_pass;
  fit_shifted #(.IN_W(LOW_PASS_W + 1), .PLACES(0), .MORE_W(POWER_W + 1), .W(LOW_PASS_W), .S(0), .ROUND(machine_pkg::ELLIPSE_LOW_PASS_ROUND),
      .WRAP(machine_pkg::ELLIPSE_LOW_PASS_WRAP)) fit_low_pass (.exact(filter), .more(twice_exponent), .word(low_pass));

  // Variance V': k'^2 * (1 + a^2 - g_x^2 ...) and the low pass.
  localparam int SHAPED_F = 2 * (SLOPE_F > TILT_F ? SLOPE_F : TILT_F);
  localparam int SLOPES_LEFT = SHAPED_F - 2 * SLOPE_F;
  localparam int TILTS_LEFT = SHAPED_F - 2 * TILT_F;
  localparam int SLOPES_W = 2 * SLOPE_W + SLOPES_LEFT;
  localparam int TILTS_W = 2 * TILT_W + TILTS_LEFT;
  localparam int TERMS_W = SLOPES_W > TILTS_W ? SLOPES_W : TILTS_W;
  localparam int SHAPED_W = (TERMS_W > SHAPED_F + 2 ? TERMS_W : SHAPED_F + 2) + 2;
  localparam [SHAPED_W-1:0] ONE = SHAPED_W'(1) << SHAPED_F;
  wire signed [SHAPED_W-1:0] aa = a * a, ab = a * b, bb = b * b;
  wire signed [SHAPED_W-1:0] gg_xx = tilt_x * tilt_x, gg_xy = tilt_x * tilt_y, gg_yy = tilt_y * tilt_y;
  wire signed [SHAPED_W-1:0] shaped_xx = $signed(ONE) + (aa <<< SLOPES_LEFT) - (gg_xx <<< TILTS_LEFT);
  wire signed [SHAPED_W-1:0] shaped_xy = (ab <<< SLOPES_LEFT) - (gg_xy <<< TILTS_LEFT);
  wire signed [SHAPED_W-1:0] shaped_yy = $signed(ONE) + (bb <<< SLOPES_LEFT) - (gg_yy <<< TILTS_LEFT);
  wire signed [SHAPE_W-1:0] shape_xx, shape_xy, shape_yy;
  fit #(.IN_W(SHAPED_W), .PLACES(SHAPED_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_xx (.exact(shaped_xx), .word(shape_xx));
  fit #(.IN_W(SHAPED_W), .PLACES(SHAPED_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_xy (.exact(shaped_xy), .word(shape_xy));
  fit #(.IN_W(SHAPED_W), .PLACES(SHAPED_F - SHAPE_F), .W(SHAPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_SHAPE_ROUND),
      .WRAP(machine_pkg::ELLIPSE_SHAPE_WRAP)) fit_shape_yy (.exact(shaped_yy), .word(shape_yy));

  localparam int SPREAD_F = SIZE_SQUARED_F + SHAPE_F;
  localparam int SPREAD_W = SIZE_SQUARED_W + SHAPE_W;
  localparam int VARIED_F = SPREAD_F > LOW_PASS_F ? SPREAD_F : LOW_PASS_F;
  localparam int SPREAD_LEFT = VARIED_F - SPREAD_F;
  localparam int FILTER_LEFT = VARIED_F - LOW_PASS_F;
  localparam int SPREADS_W = SPREAD_W + SPREAD_LEFT;
  localparam int FILTERED_W = LOW_PASS_W + 1 + FILTER_LEFT;
  localparam int VARIED_W = (SPREADS_W > FILTERED_W ? SPREADS_W : FILTERED_W) + 1;
  wire signed [VARIED_W-1:0] spread_xx = $signed({1'b0, size_squared}) * shape_xx;
  wire signed [SPREAD_W-1:0] spread_xy = $signed({1'b0, size_squared}) * shape_xy;
  wire signed [VARIED_W-1:0] spread_yy = $signed({1'b0, size_squared}) * shape_yy;
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

  // det V' = area^2 + v' * tr V' - v'^2.
  wire signed [SIZE_SQUARED_W+FACING_W-1:0] turned = $signed({1'b0, size_squared}) * facing;
  wire signed [AREA_W-1:0] area;
  fit #(.IN_W(SIZE_SQUARED_W + FACING_W), .PLACES(SIZE_SQUARED_F + FACING_F - AREA_F), .W(AREA_W), .S(1),
      .ROUND(machine_pkg::ELLIPSE_AREA_ROUND), .WRAP(machine_pkg::ELLIPSE_AREA_WRAP)) fit_area (.exact(turned), .word(area));
  localparam int TRACED_F = LOW_PASS_F + VARIANCE_F;
  localparam int LEAST_F = 2 * AREA_F > 2 * LOW_PASS_F ? 2 * AREA_F : 2 * LOW_PASS_F;
  localparam int DETERMINED_F = LEAST_F > TRACED_F ? LEAST_F : TRACED_F;
  localparam int AREAS_W = 2 * AREA_W + DETERMINED_F - 2 * AREA_F;
  localparam int TRACED_W = LOW_PASS_W + VARIANCE_W + 2 + DETERMINED_F - TRACED_F;
  localparam int FILTERS_W = 2 * LOW_PASS_W + 1 + DETERMINED_F - 2 * LOW_PASS_F;
  localparam int MOST_W = AREAS_W > TRACED_W ? AREAS_W : TRACED_W;
  localparam int DETERMINED_W = (MOST_W > FILTERS_W ? MOST_W : FILTERS_W) + 2;
  wire [VARIANCE_W:0] trace = {1'b0, variance_xx} + {1'b0, variance_yy};
  wire signed [DETERMINED_W-1:0] area_squared = area * area;
  wire signed [DETERMINED_W-1:0] traced = $signed({1'b0, low_pass}) * $signed({1'b0, trace});
  wire signed [DETERMINED_W-1:0] filter_squared = $signed({1'b0, low_pass}) * $signed({1'b0, low_pass});
  wire signed [DETERMINED_W-1:0] determined = (area_squared <<< (DETERMINED_F - 2 * AREA_F)) + (traced <<< (DETERMINED_F - TRACED_F))
      - (filter_squared <<< (DETERMINED_F - 2 * LOW_PASS_F));
  wire [DETERMINANT_W-1:0] some_determinant;
  fit #(.IN_W(DETERMINED_W), .PLACES(DETERMINED_F - DETERMINANT_F), .W(DETERMINANT_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_DETERMINANT_ROUND), .WRAP(machine_pkg::ELLIPSE_DETERMINANT_WRAP))
      fit_determinant (.exact(determined), .word(some_determinant));
  wire flat = some_determinant == '0;
  wire [DETERMINANT_W-1:0] determinant = flat ? DETERMINANT_W'(1) : some_determinant;

  wire [ROOT_BITS:0] unused_operand, root;
  wire signed [7:0] root_exponent;
  reciprocal_root #(.IN_W(DETERMINANT_W), .IN_F(DETERMINANT_F), .BITS(ROOT_BITS), .TABLE_BITS(machine_pkg::ELLIPSE_ROOT_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::ELLIPSE_ROOT_NEWTON_STEPS), .ROM("rom/ellipse.root.hex"))
      rooter (.x(determinant), .operand(unused_operand), .mantissa(root), .exponent(root_exponent));

  // Conic: V' turned about and divided by its determinant.
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
  wire [CONIC_W-1:0] conic_xx, conic_yy;
  wire [CONIC_CROSS_W-1:0] conic_xy;
  fit_shifted #(.IN_W(INVERTED_W), .PLACES(VARIANCE_F + INVERSE_F - CONIC_F), .MORE_W(POWER_W + 2), .W(CONIC_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_CONIC_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_WRAP))
      fit_conic_xx (.exact(inverted_xx), .more(conic_more), .word(conic_xx));
  fit_shifted #(.IN_W(INVERTED_CROSS_W), .PLACES(CROSS_F + INVERSE_F - CONIC_CROSS_F), .MORE_W(POWER_W + 2), .W(CONIC_CROSS_W), .S(1),
      .ROUND(machine_pkg::ELLIPSE_CONIC_CROSS_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_CROSS_WRAP))
      fit_conic_xy (.exact(inverted_xy), .more(conic_more), .word(conic_xy));
  fit_shifted #(.IN_W(INVERTED_W), .PLACES(VARIANCE_F + INVERSE_F - CONIC_F), .MORE_W(POWER_W + 2), .W(CONIC_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_CONIC_ROUND), .WRAP(machine_pkg::ELLIPSE_CONIC_WRAP))
      fit_conic_yy (.exact(inverted_yy), .more(conic_more), .word(conic_yy));

  // Amplitude.
  localparam int SEEN_W = AREA_W + ROOT_BITS + 2;
  wire [AREA_W-1:0] area_magnitude = area[AREA_W-1] ? -area : area;
  wire signed [SEEN_W-1:0] seen = $signed({1'b0, area_magnitude}) * $signed({1'b0, root});
  wire signed [8:0] visibility_more = -(9'(root_exponent));
  wire [VISIBILITY_W-1:0] visibility;
  fit_shifted #(.IN_W(SEEN_W), .PLACES(AREA_F + ROOT_BITS - VISIBILITY_F), .MORE_W(9), .W(VISIBILITY_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_VISIBILITY_ROUND), .WRAP(machine_pkg::ELLIPSE_VISIBILITY_WRAP))
      fit_visibility (.exact(seen), .more(visibility_more), .word(visibility));
  wire [INVERSE_TWO_PI_W-1:0] inverse_two_pi = INVERSE_TWO_PI_W'(machine_pkg::ELLIPSE_INVERSE_TWO_PI_WORD);
  wire signed [VISIBILITY_W+INVERSE_TWO_PI_W:0] shown = $signed({1'b0, visibility}) * $signed({1'b0, inverse_two_pi});
  wire [AMPLITUDE_W-1:0] amplitude;
  fit #(.IN_W(VISIBILITY_W + INVERSE_TWO_PI_W + 1),
      .PLACES(VISIBILITY_F + machine_pkg::ELLIPSE_INVERSE_TWO_PI_F - machine_pkg::ELLIPSE_AMPLITUDE_F), .W(AMPLITUDE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_AMPLITUDE_ROUND), .WRAP(machine_pkg::ELLIPSE_AMPLITUDE_WRAP))
      fit_amplitude (.exact(shown), .word(amplitude));
  wire dark = amplitude == '0;

  // The box: first and last row and column, inside the picture; the first lies behind the last where nothing is left.
  localparam int REACH_W = CUTOFF_W + VARIANCE_W;
  localparam int ROOTED_W = 2 * EXTENT_BITS + 3;
  localparam int BOUND_F = PIXEL_F > EXTENT_F ? PIXEL_F : EXTENT_F;
  localparam int SIDE_W = PIXEL_W - PIXEL_F > EXTENT_W - EXTENT_F + 2 ? PIXEL_W - PIXEL_F : EXTENT_W - EXTENT_F + 2;
  localparam int BOUND_W = (SIDE_W > PIXELS_W + 1 ? SIDE_W : PIXELS_W + 1) + BOUND_F + 2;
  wire [1:0] missed;
  wire [2*COLUMN_W-1:0] firsts, lasts;
  for (genvar i = 0; i < 2; i++) begin : g_side
    wire [VARIANCE_W-1:0] variance = i == 0 ? variance_yy : variance_xx;
    wire [REACH_W-1:0] some_reach = frame[machine_pkg::FRAME_CUTOFF_LSB+:CUTOFF_W] * variance;
    wire [REACH_W-1:0] reach = some_reach == '0 ? REACH_W'(1) : some_reach;
    wire [EXTENT_BITS:0] reach_operand, reach_root;
    wire signed [7:0] reach_exponent;
    reciprocal_root #(.IN_W(REACH_W), .IN_F(machine_pkg::RASTER_CUTOFF_F + VARIANCE_F), .BITS(EXTENT_BITS),
        .TABLE_BITS(machine_pkg::ELLIPSE_EXTENT_ROOT_TABLE_BITS), .NEWTON_STEPS(machine_pkg::ELLIPSE_EXTENT_ROOT_NEWTON_STEPS),
        .ROM("rom/ellipse.extent_root.hex"))
        extent_rooter (.x(reach), .operand(reach_operand), .mantissa(reach_root), .exponent(reach_exponent));
    wire signed [ROOTED_W-1:0] rooted = $signed({1'b0, reach_operand}) * $signed({1'b0, reach_root});
    wire signed [POWER_W:0] extent_more = (POWER_W + 1)'(reach_exponent) - (POWER_W + 1)'(exponent);
    wire [EXTENT_W-1:0] extent;
    fit_shifted #(.IN_W(ROOTED_W), .PLACES(2 * EXTENT_BITS - 1 - EXTENT_F), .MORE_W(POWER_W + 1), .W(EXTENT_W), .S(0),
        .ROUND(machine_pkg::ELLIPSE_EXTENT_ROUND), .WRAP(machine_pkg::ELLIPSE_EXTENT_WRAP))
        fit_extent (.exact(rooted), .more(extent_more), .word(extent));

    wire signed [PIXELS_W:0] pixels = {1'b0, frame[machine_pkg::FRAME_HEIGHT_LSB+i*PIXELS_W+:PIXELS_W]};
    wire signed [PIXELS_W:0] last_px = pixels - (PIXELS_W + 1)'(1);
    wire signed [PIXEL_W-1:0] pixel = s_data[machine_pkg::ELLIPSE_IN_PIXEL_Y_LSB+i*PIXEL_W+:PIXEL_W];
    // From the centre of pixel 0 to the picture's middle: half of last_px.
    wire signed [BOUND_W-1:0] centre = (BOUND_W'(pixel) <<< (BOUND_F - PIXEL_F)) + (BOUND_W'(last_px) <<< (BOUND_F - 1));
    // A place more than it is, so that no rounding loses a pixel.
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

  // The depth plane.
  wire [FACING_W-1:0] facing_magnitude = facing[FACING_W-1] ? -facing : facing;
  wire [STEEP_BITS:0] steepness;
  wire signed [7:0] steepness_exponent;
  reciprocal #(.IN_W(FACING_W), .IN_F(FACING_F), .BITS(STEEP_BITS), .TABLE_BITS(machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_NEWTON_STEPS), .ROM("rom/ellipse.slope_reciprocal.hex"))
      inverter (.x(facing_magnitude), .mantissa(steepness), .exponent(steepness_exponent));
  wire [INVERSE_FOCAL_W-1:0] inverse_focal = frame[machine_pkg::FRAME_INVERSE_FOCAL_LSB+:INVERSE_FOCAL_W];
  wire signed [7:0] inverse_focal_places = frame[machine_pkg::FRAME_INVERSE_FOCAL_PLACES_LSB+:8];
  wire signed [FORWARD_W+INVERSE_FOCAL_W-1:0] stepped = forward * $signed({1'b0, inverse_focal});
  wire [STEP_W-1:0] step, scale;
  fit #(.IN_W(FORWARD_W + INVERSE_FOCAL_W), .PLACES(machine_pkg::PROJECT_CAMERA_F + machine_pkg::ELLIPSE_INVERSE_FOCAL_F - STEP_F),
      .W(STEP_W), .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_STEP_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_STEP_WRAP))
      fit_step (.exact(stepped), .word(step));
  wire signed [STEP_W+STEEP_BITS+1:0] steep = $signed({1'b0, step}) * $signed({1'b0, steepness});
  fit #(.IN_W(STEP_W + STEEP_BITS + 2), .PLACES(STEEP_BITS), .W(STEP_W), .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_STEP_ROUND),
      .WRAP(machine_pkg::ELLIPSE_DEPTH_STEP_WRAP)) fit_scale (.exact(steep), .word(scale));
  wire signed [STEP_W:0] away = facing[FACING_W-1] ? $signed({1'b0, scale}) : -$signed({1'b0, scale});
  wire signed [STEP_W+NORMAL_W:0] leaning_x = away * normal_x, leaning_y = away * normal_y;
  wire signed [POWER_W-1:0] leaning_more = POWER_W'(inverse_focal_places) - POWER_W'(steepness_exponent) - POWER_W'(point_exponent);
  wire [DEPTH_SLOPE_W-1:0] depth_slope_x, depth_slope_y;
  fit_shifted #(.IN_W(STEP_W + NORMAL_W + 1), .PLACES(STEP_F + NORMAL_F - machine_pkg::ELLIPSE_DEPTH_SLOPE_F), .MORE_W(POWER_W),
      .W(DEPTH_SLOPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_DEPTH_SLOPE_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_SLOPE_WRAP))
      fit_depth_slope_x (.exact(leaning_x), .more(leaning_more), .word(depth_slope_x));
  fit_shifted #(.IN_W(STEP_W + NORMAL_W + 1), .PLACES(STEP_F + NORMAL_F - machine_pkg::ELLIPSE_DEPTH_SLOPE_F), .MORE_W(POWER_W),
      .W(DEPTH_SLOPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_DEPTH_SLOPE_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_SLOPE_WRAP))
      fit_depth_slope_y (.exact(leaning_y), .more(leaning_more), .word(depth_slope_y));
  wire [ROOT_CUTOFF_W-1:0] root_cutoff = frame[machine_pkg::FRAME_ROOT_CUTOFF_LSB+:ROOT_CUTOFF_W];
  wire signed [RADIUS_W+ROOT_CUTOFF_W:0] deep = $signed({1'b0, radius}) * $signed({1'b0, root_cutoff});
  wire [DEPTH_RANGE_W-1:0] depth_range;
  fit #(.IN_W(RADIUS_W + ROOT_CUTOFF_W + 1),
      .PLACES(machine_pkg::SPLAT_RADIUS_F + machine_pkg::ELLIPSE_ROOT_CUTOFF_F - machine_pkg::ELLIPSE_DEPTH_RANGE_F), .W(DEPTH_RANGE_W),
      .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_RANGE_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_RANGE_WRAP))
      fit_depth_range (.exact(deep), .word(depth_range));

  // The first reason that holds.
  wire faint = !backface && (blind || flat || dark);
  wire outside = !backface && !faint && |missed;
  wire [machine_pkg::ELLIPSE_OUT_W-4:0] drawn = {fragment_normal, conic_xx, conic_xy, conic_yy, amplitude, firsts[COLUMN_W+:COLUMN_W],
      lasts[COLUMN_W+:COLUMN_W], firsts[0+:COLUMN_W], lasts[0+:COLUMN_W], depth_slope_x, depth_slope_y, depth_range};
  wire [machine_pkg::ELLIPSE_OUT_W-1:0] result = {backface, faint, outside, backface || faint || outside ? '0 : drawn};
  // The frame has constants for other units too.
  wire unused = &{1'b0, frame};

  pipe #(.W(machine_pkg::ELLIPSE_OUT_W), .LATENCY(machine_pkg::ELLIPSE_LATENCY), .INTERVAL(machine_pkg::ELLIPSE_INTERVAL),
      .ROOM(machine_pkg::ELLIPSE_ROOM)) behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_data(result),
      .m_valid(m_valid), .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
