// Ellipse: turns a normal and a radius into a conic, an amplitude, a box and a depth plane. RTL
// implementation of units/ellipse.rs.
//
//   radius ->(* focal)->(* 1/t_z)-> size k' = k/2^e ---> k'^2 -+------------------------>(*)-> variance V' -+-> extent -> box
//   normal ->[ W*n ]-+-> tilt g ->[ 1+a^2 .. - gg' ]-> shape --+     low_pass v/4^e -----(+)--+             |
//                    +-> facing c_n -> area k'^2*c_n -> determinant ->[ 1/sqrt ]-+-> inverse ->(*)----------+-> conic
//                          +->[ 1/|c_n| ]-> depth_slope                          +-> visibility -> amplitude
//
// The parts that it shares with ellipsoid are in the files ellipse_*.sv, one for each function of
// the Rust unit.
//
// Each splat is computed relative to a power of two 2^e near its own radius in pixels, so small and
// large footprints have the same relative precision.
//
// Losses: every word is rounded, except scaled_radius, which a normaliser truncates. The extent has
// one more LSB than necessary, so the box never loses a pixel. depth_slope is limited, because a
// grazing plane's slope has no limit.
`timescale 1ns / 1ps
`default_nettype none

module ellipse #(
    parameter int DROPS = 0, // 1: culled splats end here
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                           // clock, rising edge
    input wire rst,                                           // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,              // constants: the view
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
  // Sums of two powers of two of 8 bits and a normaliser's shift.
  localparam int POWER_W = 10;

  // The splat and its point. Vectors are packed as in a record: (z,) y, x from the LSB on.
  wire [RADIUS_W-1:0] some_radius = s_data[machine_pkg::ELLIPSE_IN_RADIUS_LSB+:RADIUS_W];
  wire signed [FORWARD_W-1:0] forward = s_data[machine_pkg::ELLIPSE_IN_FORWARD_LSB+:FORWARD_W];
  wire signed [7:0] point_exponent = s_data[machine_pkg::ELLIPSE_IN_EXPONENT_LSB+:8];
  wire [INVERSE_DEPTH_BITS:0] inverse_depth = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_LSB+:INVERSE_DEPTH_BITS+1];
  wire signed [7:0] inverse_depth_exponent = s_data[machine_pkg::ELLIPSE_IN_INVERSE_DEPTH_EXPONENT_LSB+:8];
  wire signed [SLOPE_W-1:0] a = s_data[machine_pkg::ELLIPSE_IN_SLOPE_X_LSB+:SLOPE_W];
  wire signed [SLOPE_W-1:0] b = s_data[machine_pkg::ELLIPSE_IN_SLOPE_Y_LSB+:SLOPE_W];

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

  // Inclination of the splat to its ray: tilt g, and facing c_n.
  wire signed [TILT_W-1:0] tilt_x, tilt_y;
  wire signed [FACING_W-1:0] some_facing;
  ellipse_turn turn (.a(a), .b(b), .normal(normal), .tilt_x(tilt_x), .tilt_y(tilt_y), .facing(some_facing));

  wire backface = frame[machine_pkg::FRAME_CULL_BACKFACES_LSB] && some_facing > FACING_W'(0);
  wire blind = some_facing == '0 || some_radius == '0;
  // Divisors are never 0, also for culled splats.
  wire signed [FACING_W-1:0] facing = blind ? FACING_W'(1) : some_facing;
  wire [RADIUS_W-1:0] radius = some_radius == '0 ? RADIUS_W'(1) : some_radius;

  wire [3*SIZE_SQUARED_W-1:0] sizes_squared;
  wire signed [POWER_W-1:0] exponent;
  ellipse_size #(.POWER_W(POWER_W)) sizer (.frame(frame), .radius(radius), .point_exponent(point_exponent), .inverse_depth(inverse_depth),
      .inverse_depth_exponent(inverse_depth_exponent), .sizes_squared(sizes_squared), .exponent(exponent));

  // Shape: 1 + a^2 - g_x^2 ...
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

  wire [AREA_W-1:0] areas;
  wire [ROOT_BITS:0] root;
  wire signed [7:0] root_exponent;
  wire flat, missed;
  wire [CONIC_W-1:0] conic_xx, conic_yy;
  wire [CONIC_CROSS_W-1:0] conic_xy;
  wire [2*COLUMN_W-1:0] firsts, lasts;
  ellipse_footprint #(.FACES(1), .POWER_W(POWER_W), .ROMS(ROMS)) footprint (.frame(frame),
      .cutoff(frame[machine_pkg::FRAME_CUTOFF_LSB+:machine_pkg::RASTER_CUTOFF_W]),
      .pixels_from_middle(s_data[machine_pkg::ELLIPSE_IN_PIXEL_Y_LSB+:2*PIXEL_W]), .sizes_squared(sizes_squared), .exponent(exponent),
      .shape_xx(shape_xx), .shape_xy(shape_xy), .shape_yy(shape_yy), .faces(facing), .areas(areas), .root(root),
      .root_exponent(root_exponent), .flat(flat), .conic_xx(conic_xx), .conic_xy(conic_xy), .conic_yy(conic_yy), .firsts(firsts),
      .lasts(lasts), .outside(missed));

  // Amplitude.
  wire [VISIBILITY_W-1:0] visibility;
  ellipse_visibility show (.area(areas), .root(root), .root_exponent(root_exponent), .visibility(visibility));
  wire [INVERSE_TWO_PI_W-1:0] inverse_two_pi = INVERSE_TWO_PI_W'(machine_pkg::ELLIPSE_INVERSE_TWO_PI_WORD);
  wire signed [VISIBILITY_W+INVERSE_TWO_PI_W:0] shown = $signed({1'b0, visibility}) * $signed({1'b0, inverse_two_pi});
  wire [AMPLITUDE_W-1:0] amplitude;
  fit #(.IN_W(VISIBILITY_W + INVERSE_TWO_PI_W + 1),
      .PLACES(VISIBILITY_F + machine_pkg::ELLIPSE_INVERSE_TWO_PI_F - machine_pkg::ELLIPSE_AMPLITUDE_F), .W(AMPLITUDE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_AMPLITUDE_ROUND), .WRAP(machine_pkg::ELLIPSE_AMPLITUDE_WRAP))
      fit_amplitude (.exact(shown), .word(amplitude));
  wire dark = amplitude == '0;

  wire [DEPTH_SLOPE_W-1:0] depth_slope_x, depth_slope_y;
  wire [DEPTH_RANGE_W-1:0] depth_range;
  ellipse_plane #(.POWER_W(POWER_W), .ROMS(ROMS)) plane (.frame(frame), .radius(radius), .forward(forward), .point_exponent(point_exponent),
      .facing(facing), .normal_x(normal[2*NORMAL_W+:NORMAL_W]), .normal_y(normal[NORMAL_W+:NORMAL_W]), .depth_slope_x(depth_slope_x), .depth_slope_y(depth_slope_y),
      .depth_range(depth_range));

  // The first cull reason that holds.
  wire faint = !backface && (blind || flat || dark);
  wire outside = !backface && !faint && missed;
  wire [machine_pkg::ELLIPSE_OUT_W-4:0] drawn = {fragment_normal, conic_xx, conic_xy, conic_yy, amplitude, firsts[COLUMN_W+:COLUMN_W],
      lasts[COLUMN_W+:COLUMN_W], firsts[0+:COLUMN_W], lasts[0+:COLUMN_W], depth_slope_x, depth_slope_y, depth_range};
  wire [machine_pkg::ELLIPSE_OUT_W-1:0] result = {backface, faint, outside, backface || faint || outside ? '0 : drawn};
  // The frame also has constants for other units.
  wire unused = &{1'b0, frame};

  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::ELLIPSE_OUT_W;
  wire keeps = DROPS == 0 || !(backface || faint || outside);
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::ELLIPSE_IN_W, result});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::ELLIPSE_LATENCY), .INTERVAL(machine_pkg::ELLIPSE_INTERVAL), .ROOM(machine_pkg::ELLIPSE_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(keeps), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
