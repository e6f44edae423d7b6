// Ellipse_plane: the depth plane of a disc. RTL implementation of `depth_slope` in
// units/ellipse.rs, and of its depth_range.
//
//   forward ->(* 1/s)-> step ->(* 1/|c_n|)-> scale ->(* normal)-> depth_slope, for each side of a pixel
//   radius ->(* root_cutoff)-> depth_range
//
// Losses: every word is rounded. depth_slope is limited, because a grazing plane's slope has no
// limit.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_plane #(
    parameter int POWER_W = 10, // bits of sums of powers of two
    parameter ROMS = "rom/"     // folder of the tables, with its slash
) (
    // Only the focal length and the cutoff are used of the frame's constants.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                            // constants: the view
    // verilator lint_on UNUSEDSIGNAL
    input wire [machine_pkg::SPLAT_RADIUS_W-1:0] radius,                    // the splat's
    input wire signed [machine_pkg::PROJECT_CAMERA_W-1:0] forward,          // its centre's depth
    input wire signed [7:0] point_exponent,                                 // and the power of two that this is relative to
    input wire signed [machine_pkg::ELLIPSE_FACING_W-1:0] facing,           // c_n, not 0
    input wire signed [machine_pkg::ELLIPSE_NORMAL_W-1:0] normal_x,         // the normal
    input wire signed [machine_pkg::ELLIPSE_NORMAL_W-1:0] normal_y,         // likewise
    output wire [machine_pkg::ELLIPSE_DEPTH_SLOPE_W-1:0] depth_slope_x,     // from column to column
    output wire [machine_pkg::ELLIPSE_DEPTH_SLOPE_W-1:0] depth_slope_y,     // from row to row
    output wire [machine_pkg::ELLIPSE_DEPTH_RANGE_W-1:0] depth_range        // half-width of the depth clamp
);
  localparam int RADIUS_W = machine_pkg::SPLAT_RADIUS_W;
  localparam int FORWARD_W = machine_pkg::PROJECT_CAMERA_W;
  localparam int NORMAL_W = machine_pkg::ELLIPSE_NORMAL_W;
  localparam int NORMAL_F = machine_pkg::ELLIPSE_NORMAL_F;
  localparam int FACING_W = machine_pkg::ELLIPSE_FACING_W;
  localparam int FACING_F = machine_pkg::ELLIPSE_FACING_F;
  localparam int STEEP_BITS = machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_BITS;
  localparam int INVERSE_FOCAL_W = machine_pkg::ELLIPSE_INVERSE_FOCAL_W;
  localparam int STEP_W = machine_pkg::ELLIPSE_DEPTH_STEP_W;
  localparam int STEP_F = machine_pkg::ELLIPSE_DEPTH_STEP_F;
  localparam int DEPTH_SLOPE_W = machine_pkg::ELLIPSE_DEPTH_SLOPE_W;
  localparam int ROOT_CUTOFF_W = machine_pkg::ELLIPSE_ROOT_CUTOFF_W;
  localparam int DEPTH_RANGE_W = machine_pkg::ELLIPSE_DEPTH_RANGE_W;

  wire [FACING_W-1:0] facing_magnitude = facing[FACING_W-1] ? -facing : facing;
  wire [STEEP_BITS:0] steepness;
  wire signed [7:0] steepness_exponent;
  reciprocal #(.IN_W(FACING_W), .IN_F(FACING_F), .BITS(STEEP_BITS), .TABLE_BITS(machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_TABLE_BITS),
      .NEWTON_STEPS(machine_pkg::ELLIPSE_SLOPE_RECIPROCAL_NEWTON_STEPS), .ROM({ROMS, "ellipse.slope_reciprocal.hex"}))
      inverter (.x(facing_magnitude), .mantissa(steepness), .exponent(steepness_exponent));
  // If all pixels are square, both registers and both steps are equal.
  wire [2*NORMAL_W-1:0] normal = {normal_x, normal_y};
  wire [2*DEPTH_SLOPE_W-1:0] depth_slope;
  for (genvar i = 0; i < 2; i++) begin : g_slope
    wire [INVERSE_FOCAL_W-1:0] inverse_focal =
        frame[(i == 0 ? machine_pkg::VIEW_INVERSE_FOCAL_Y_LSB : machine_pkg::VIEW_INVERSE_FOCAL_X_LSB)+:INVERSE_FOCAL_W];
    wire signed [7:0] inverse_focal_places =
        frame[(i == 0 ? machine_pkg::VIEW_INVERSE_FOCAL_Y_PLACES_LSB : machine_pkg::VIEW_INVERSE_FOCAL_X_PLACES_LSB)+:8];
    wire signed [FORWARD_W+INVERSE_FOCAL_W-1:0] stepped = forward * $signed({1'b0, inverse_focal});
    wire [STEP_W-1:0] step, scale;
    fit #(.IN_W(FORWARD_W + INVERSE_FOCAL_W), .PLACES(machine_pkg::PROJECT_CAMERA_F + machine_pkg::ELLIPSE_INVERSE_FOCAL_F - STEP_F),
        .W(STEP_W), .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_STEP_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_STEP_WRAP))
        fit_step (.exact(stepped), .word(step));
    wire signed [STEP_W+STEEP_BITS+1:0] steep = $signed({1'b0, step}) * $signed({1'b0, steepness});
    fit #(.IN_W(STEP_W + STEEP_BITS + 2), .PLACES(STEEP_BITS), .W(STEP_W), .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_STEP_ROUND),
        .WRAP(machine_pkg::ELLIPSE_DEPTH_STEP_WRAP)) fit_scale (.exact(steep), .word(scale));
    wire signed [STEP_W:0] away = facing[FACING_W-1] ? $signed({1'b0, scale}) : -$signed({1'b0, scale});
    wire signed [NORMAL_W-1:0] part = normal[i*NORMAL_W+:NORMAL_W];
    wire signed [STEP_W+NORMAL_W:0] leaning = away * part;
    wire signed [POWER_W-1:0] leaning_more = POWER_W'(inverse_focal_places) - POWER_W'(steepness_exponent) - POWER_W'(point_exponent);
    fit_shifted #(.IN_W(STEP_W + NORMAL_W + 1), .PLACES(STEP_F + NORMAL_F - machine_pkg::ELLIPSE_DEPTH_SLOPE_F), .MORE_W(POWER_W),
        .W(DEPTH_SLOPE_W), .S(1), .ROUND(machine_pkg::ELLIPSE_DEPTH_SLOPE_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_SLOPE_WRAP))
        fit_depth_slope (.exact(leaning), .more(leaning_more), .word(depth_slope[i*DEPTH_SLOPE_W+:DEPTH_SLOPE_W]));
  end
  assign {depth_slope_x, depth_slope_y} = depth_slope;
  wire [ROOT_CUTOFF_W-1:0] root_cutoff = frame[machine_pkg::FRAME_ROOT_CUTOFF_LSB+:ROOT_CUTOFF_W];
  wire signed [RADIUS_W+ROOT_CUTOFF_W:0] deep = $signed({1'b0, radius}) * $signed({1'b0, root_cutoff});
  fit #(.IN_W(RADIUS_W + ROOT_CUTOFF_W + 1),
      .PLACES(machine_pkg::SPLAT_RADIUS_F + machine_pkg::ELLIPSE_ROOT_CUTOFF_F - machine_pkg::ELLIPSE_DEPTH_RANGE_F), .W(DEPTH_RANGE_W),
      .S(0), .ROUND(machine_pkg::ELLIPSE_DEPTH_RANGE_ROUND), .WRAP(machine_pkg::ELLIPSE_DEPTH_RANGE_WRAP))
      fit_depth_range (.exact(deep), .word(depth_range));
endmodule

`default_nettype wire
