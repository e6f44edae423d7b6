// Project: transforms a splat's centre to camera space and to the screen. RTL implementation of
// units/project.rs.
//
//   position ->(- eye)->[ << ]-> relative ->[ W* ]-> camera t -+->[ 1/t_z ]-> inverse_depth -+
//                         +-> exponent -----------+            +----------------------------(*)-> slope ->(* focal)->(+ centre)-> pixel
//                                                 +----------->[ >> ]-> depth t_z
//
// t is relative to a power of two near the splat's distance from the eye, so near and far splats
// have the same relative precision.
//
// The record of an ellipsoid includes its opacity: if it is too low, none of its weights would
// count.
//
// Losses: relative is truncated by its normaliser; camera, depth, slope and pixel are rounded. The
// reciprocal lists the losses of its inner words.
`timescale 1ns / 1ps
`default_nettype none

module project #(
    parameter int DROPS = 0, // 1: culled splats end here
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                           // clock, rising edge
    input wire rst,                                           // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,              // constants: the view
    input wire s_valid,                                       // a splat is there
    output wire s_ready,                                      // and can be taken
    input wire [TAG_W+machine_pkg::PROJECT_IN_W-1:0] s_data,  // the tag, project.in
    output wire m_valid,                                      // a point is offered
    input wire m_ready,                                       // and taken
    output wire [TAG_W+machine_pkg::PROJECT_OUT_W-1:0] m_data // the tag, project.out
);
  localparam int POSITION_W = machine_pkg::SPLAT_POSITION_W;
  localparam int POSITION_F = machine_pkg::SPLAT_POSITION_F;
  localparam int EYE_W = machine_pkg::PROJECT_EYE_W;
  localparam int EYE_F = machine_pkg::PROJECT_EYE_F;
  localparam int RELATIVE_W = machine_pkg::PROJECT_RELATIVE_W;
  localparam int RELATIVE_F = machine_pkg::PROJECT_RELATIVE_F;
  localparam int ROTATION_W = machine_pkg::PROJECT_ROTATION_W;
  localparam int CAMERA_W = machine_pkg::PROJECT_CAMERA_W;
  localparam int CAMERA_F = machine_pkg::PROJECT_CAMERA_F;
  localparam int DEPTH_W = machine_pkg::PROJECT_DEPTH_W;
  localparam int INVERSE_BITS = machine_pkg::PROJECT_RECIPROCAL_BITS;
  localparam int SLOPE_W = machine_pkg::PROJECT_SLOPE_W;
  localparam int SLOPE_F = machine_pkg::PROJECT_SLOPE_F;
  localparam int FOCAL_W = machine_pkg::PROJECT_FOCAL_W;
  localparam int PIXEL_W = machine_pkg::PROJECT_PIXEL_W;
  localparam int PIXEL_F = machine_pkg::PROJECT_PIXEL_F;

  // Position and eye with a common binary point.
  localparam int DIFFERENCE_F = POSITION_F > EYE_F ? POSITION_F : EYE_F;
  localparam int POSITION_LEFT = DIFFERENCE_F - POSITION_F;
  localparam int EYE_LEFT = DIFFERENCE_F - EYE_F;
  localparam int MAGNITUDE_W = POSITION_W + POSITION_LEFT > EYE_W + EYE_LEFT ? POSITION_W + POSITION_LEFT : EYE_W + EYE_LEFT;
  localparam int DIFFERENCE_W = MAGNITUDE_W + 1;
  // |t| aligned with guard * t_z.
  localparam int LIMIT_W = CAMERA_W + (SLOPE_W > SLOPE_F + 1 ? SLOPE_W : SLOPE_F + 1);

  // A product of focal length and slope, and the principal point, with a common binary point.
  localparam int SCREEN_F = machine_pkg::PROJECT_FOCAL_F + SLOPE_F;
  localparam int PLACED_F = SCREEN_F > PIXEL_F ? SCREEN_F : PIXEL_F;
  localparam int SCREEN_LEFT = PLACED_F - SCREEN_F;
  localparam int CENTRE_LEFT = PLACED_F - PIXEL_F;
  localparam int PLACED_W = (FOCAL_W + SLOPE_W + SCREEN_LEFT > PIXEL_W + CENTRE_LEFT ? FOCAL_W + SLOPE_W + SCREEN_LEFT : PIXEL_W + CENTRE_LEFT) + 1;

  // Vectors are packed as in a record: z, y, x from the LSB on.
  wire signed [7:0] lead;
  wire [3*MAGNITUDE_W-1:0] magnitude;
  wire [3*RELATIVE_W-1:0] relative;
  for (genvar i = 0; i < 3; i++) begin : g_relative
    wire signed [POSITION_W-1:0] position = s_data[machine_pkg::PROJECT_IN_POSITION_Z_LSB+i*POSITION_W+:POSITION_W];
    wire signed [EYE_W-1:0] eye = frame[machine_pkg::FRAME_EYE_Z_LSB+i*EYE_W+:EYE_W];
    wire signed [DIFFERENCE_W-1:0] difference = (DIFFERENCE_W'(position) <<< POSITION_LEFT) - (DIFFERENCE_W'(eye) <<< EYE_LEFT);
    assign magnitude[i*MAGNITUDE_W+:MAGNITUDE_W] = MAGNITUDE_W'(difference[DIFFERENCE_W-1] ? -difference : difference);
    wire signed [DIFFERENCE_W-1:0] normalised = difference <<< lead;
    fit #(.IN_W(DIFFERENCE_W), .PLACES(MAGNITUDE_W - RELATIVE_F), .W(RELATIVE_W), .S(1), .ROUND(machine_pkg::PROJECT_RELATIVE_ROUND),
        .WRAP(machine_pkg::PROJECT_RELATIVE_WRAP)) fit_relative (.exact(normalised), .word(relative[i*RELATIVE_W+:RELATIVE_W]));
  end

  // All components are shifted by the shift of the largest, which is then in [1/2, 1).
  wire [MAGNITUDE_W-1:0] largest =
      magnitude[2*MAGNITUDE_W+:MAGNITUDE_W] | magnitude[MAGNITUDE_W+:MAGNITUDE_W] | magnitude[0+:MAGNITUDE_W] | MAGNITUDE_W'(1);
  wire [MAGNITUDE_W-1:0] unused_normalised;
  normalise #(.W(MAGNITUDE_W)) normaliser (.value(largest), .normalised(unused_normalised), .lead(lead));
  wire signed [7:0] exponent = 8'(MAGNITUDE_W - DIFFERENCE_F) - lead;

  wire [3*CAMERA_W-1:0] camera;
  for (genvar i = 0; i < 3; i++) begin : g_camera
    wire signed [ROTATION_W+RELATIVE_W:0] rotated;
    dot #(.A_W(ROTATION_W), .B_W(RELATIVE_W)) rotate (
        .a(frame[machine_pkg::FRAME_ROTATION_22_LSB+i*3*ROTATION_W+:3*ROTATION_W]), .b(relative), .sum(rotated));
    fit #(.IN_W(ROTATION_W + RELATIVE_W + 1), .PLACES(machine_pkg::PROJECT_ROTATION_F + RELATIVE_F - CAMERA_F), .W(CAMERA_W), .S(1),
        .ROUND(machine_pkg::PROJECT_CAMERA_ROUND), .WRAP(machine_pkg::PROJECT_CAMERA_WRAP))
        fit_camera (.exact(rotated), .word(camera[i*CAMERA_W+:CAMERA_W]));
  end
  wire signed [CAMERA_W-1:0] camera_z = camera[0+:CAMERA_W];
  wire ahead = camera_z > CAMERA_W'(0);
  wire signed [CAMERA_W-1:0] forward = ahead ? camera_z : CAMERA_W'(1);

  wire signed [CAMERA_W-1:0] natural = ahead ? camera_z : CAMERA_W'(0);
  wire signed [8:0] depth_more = -(9'(exponent));
  wire [DEPTH_W-1:0] depth;
  fit_shifted #(.IN_W(CAMERA_W), .PLACES(CAMERA_F - machine_pkg::PROJECT_DEPTH_F), .MORE_W(9), .W(DEPTH_W), .S(0),
      .ROUND(machine_pkg::PROJECT_DEPTH_ROUND), .WRAP(machine_pkg::PROJECT_DEPTH_WRAP))
      fit_depth (.exact(natural), .more(depth_more), .word(depth));
  wire near = depth <= frame[machine_pkg::FRAME_NEAR_LSB+:DEPTH_W];

  wire [INVERSE_BITS:0] inverse_depth;
  wire signed [7:0] inverse_depth_exponent;
  reciprocal #(.IN_W(CAMERA_W - 1), .IN_F(CAMERA_F), .BITS(INVERSE_BITS), .TABLE_BITS(machine_pkg::PROJECT_RECIPROCAL_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::PROJECT_RECIPROCAL_NEWTON_STEPS), .ROM({ROMS, "project.reciprocal.hex"}))
      inverter (.x(forward[CAMERA_W-2:0]), .mantissa(inverse_depth), .exponent(inverse_depth_exponent));

  wire signed [8:0] slope_more = -(9'(inverse_depth_exponent));
  wire [1:0] beyond;
  wire [2*SLOPE_W-1:0] slope;
  wire [2*PIXEL_W-1:0] pixel;
  for (genvar i = 0; i < 2; i++) begin : g_screen
    wire signed [CAMERA_W-1:0] offset = camera[(i+1)*CAMERA_W+:CAMERA_W];
    // Before the division, so that quotients never saturate.
    wire signed [SLOPE_W-1:0] guard = frame[machine_pkg::FRAME_GUARD_Y_LSB+i*SLOPE_W+:SLOPE_W];
    wire signed [LIMIT_W-1:0] limit = guard * forward;
    wire signed [LIMIT_W-1:0] aligned = LIMIT_W'(offset) <<< SLOPE_F;
    assign beyond[i] = (aligned[LIMIT_W-1] ? -aligned : aligned) > limit;

    wire signed [CAMERA_W+INVERSE_BITS:0] quotient = offset * $signed({1'b0, inverse_depth});
    wire signed [SLOPE_W-1:0] tangent;
    fit_shifted #(.IN_W(CAMERA_W + INVERSE_BITS + 1), .PLACES(CAMERA_F + INVERSE_BITS - SLOPE_F), .MORE_W(9), .W(SLOPE_W), .S(1),
        .ROUND(machine_pkg::PROJECT_SLOPE_ROUND), .WRAP(machine_pkg::PROJECT_SLOPE_WRAP))
        fit_slope (.exact(quotient), .more(slope_more), .word(tangent));
    assign slope[i*SLOPE_W+:SLOPE_W] = tangent;

    // Focal length and principal point of this axis, relative to the picture's middle.
    wire [FOCAL_W-1:0] focal = frame[(i == 0 ? machine_pkg::VIEW_FOCAL_Y_LSB : machine_pkg::VIEW_FOCAL_X_LSB)+:FOCAL_W];
    wire signed [PIXEL_W-1:0] centre = frame[machine_pkg::FRAME_CENTRE_Y_LSB+i*PIXEL_W+:PIXEL_W];
    wire signed [FOCAL_W+SLOPE_W-1:0] screen = $signed({1'b0, focal}) * tangent;
    wire signed [PLACED_W-1:0] placed = (PLACED_W'(screen) <<< SCREEN_LEFT) + (PLACED_W'(centre) <<< CENTRE_LEFT);
    fit #(.IN_W(PLACED_W), .PLACES(PLACED_F - PIXEL_F), .W(PIXEL_W), .S(1), .ROUND(machine_pkg::PROJECT_PIXEL_ROUND),
        .WRAP(machine_pkg::PROJECT_PIXEL_WRAP)) fit_pixel (.exact(placed), .word(pixel[i*PIXEL_W+:PIXEL_W]));
  end
  wire outside = !near && |beyond;

  // For ellipsoids also the opacity, in the low bits of the record.
  localparam int OPACITY_W = machine_pkg::PROJECT_OPACITY_W;
  localparam int FLAGS_W = OPACITY_W > 0 ? 3 : 2;
  wire [FLAGS_W-1:0] culled;
  if (OPACITY_W > 0) begin : g_opacity
    wire transparent = s_data[OPACITY_W-1:0] < frame[machine_pkg::PROJECT_LEAST_OPACITY_LSB+:OPACITY_W];
    assign culled = {near, outside, !near && !outside && transparent};
  end else begin : g_no_opacity
    assign culled = {near, outside};
  end

  // The frame also has constants for other units.
  wire unused = &{1'b0, frame};

  wire [machine_pkg::PROJECT_OUT_W-FLAGS_W-1:0] point = {forward, exponent, depth, inverse_depth, inverse_depth_exponent, slope, pixel};
  wire [machine_pkg::PROJECT_OUT_W-1:0] result = {culled, |culled ? '0 : point};
  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::PROJECT_OUT_W;
  wire keeps = DROPS == 0 || !(|culled);
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::PROJECT_IN_W, result});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::PROJECT_LATENCY), .INTERVAL(machine_pkg::PROJECT_INTERVAL), .ROOM(machine_pkg::PROJECT_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(keeps), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
