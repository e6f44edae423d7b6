// Ellipse_size: a radius in pixels, relative to a power of two near it. RTL implementation of
// `size` in units/ellipse.rs.
//
//   radius ->(* focal)->(* 1/t_z)-> size k' = k/2^e -> k'^2 ->(* aspect)-> k'_x^2, k'_x*k'_y, k'_y^2
//
// The focal length is the larger one of the two. If the machine draws only square pixels, all three
// are k'^2.
//
// Losses: scaled_radius is truncated by a normaliser; size and its square are rounded.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_size #(
    parameter int POWER_W = 10 // bits of sums of two powers of two of 8 bits and a normaliser's places
) (
    // Only the lens is used of the frame's constants.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                              // constants: the view
    // verilator lint_on UNUSEDSIGNAL
    input wire [machine_pkg::SPLAT_RADIUS_W-1:0] radius,                      // the splat's, not 0
    input wire signed [7:0] point_exponent,                                   // the power of two that its centre is relative to
    input wire [machine_pkg::PROJECT_RECIPROCAL_BITS:0] inverse_depth,        // 1/t_z
    input wire signed [7:0] inverse_depth_exponent,                           // and its power of two
    output wire [3*machine_pkg::ELLIPSE_SIZE_SQUARED_W-1:0] sizes_squared,    // k'_x^2, k'_x*k'_y, k'_y^2, the first on top
    output wire signed [POWER_W-1:0] exponent                                 // e
);
  localparam int RADIUS_W = machine_pkg::SPLAT_RADIUS_W;
  localparam int INVERSE_DEPTH_BITS = machine_pkg::PROJECT_RECIPROCAL_BITS;
  localparam int FOCAL_W = machine_pkg::PROJECT_FOCAL_W;
  localparam int SCALED_RADIUS_W = machine_pkg::ELLIPSE_SCALED_RADIUS_W;
  localparam int SCALED_RADIUS_F = machine_pkg::ELLIPSE_SCALED_RADIUS_F;
  localparam int SIZE_W = machine_pkg::ELLIPSE_SIZE_W;
  localparam int SIZE_F = machine_pkg::ELLIPSE_SIZE_F;
  localparam int SIZE_SQUARED_W = machine_pkg::ELLIPSE_SIZE_SQUARED_W;
  localparam int SIZE_SQUARED_F = machine_pkg::ELLIPSE_SIZE_SQUARED_F;

  wire [SIZE_SQUARED_W-1:0] size_squared;
  // Size k' = k/2^e, and e: k = scaled_radius * inverse_depth * 2^power, with the product in [1/2,
  // 2].
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
  assign exponent = power < POWER_W'(0) ? POWER_W'(0) : power + POWER_W'(1);
  wire signed [POWER_W-1:0] size_more = exponent - power;
  wire signed [SIZED_W-1:0] sized = $signed({1'b0, scaled_radius}) * $signed({1'b0, inverse_depth});
  wire [SIZE_W-1:0] size;
  fit_shifted #(.IN_W(SIZED_W), .PLACES(SCALED_RADIUS_F + INVERSE_DEPTH_BITS - SIZE_F), .MORE_W(POWER_W), .W(SIZE_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_SIZE_ROUND), .WRAP(machine_pkg::ELLIPSE_SIZE_WRAP))
      fit_size (.exact(sized), .more(size_more), .word(size));
  wire signed [2*SIZE_W:0] squared = $signed({1'b0, size}) * $signed({1'b0, size});
  fit #(.IN_W(2 * SIZE_W + 1), .PLACES(2 * SIZE_F - SIZE_SQUARED_F), .W(SIZE_SQUARED_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_SIZE_SQUARED_ROUND), .WRAP(machine_pkg::ELLIPSE_SIZE_SQUARED_WRAP))
      fit_size_squared (.exact(squared), .word(size_squared));

  localparam int ASPECT_W = machine_pkg::VIEW_ASPECT_W;
  if (ASPECT_W > 0) begin : g_aspect
    for (genvar i = 0; i < 3; i++) begin : g_side
      wire [ASPECT_W-1:0] aspect = frame[machine_pkg::VIEW_ASPECT_YY_LSB+i*ASPECT_W+:ASPECT_W];
      wire signed [SIZE_SQUARED_W+ASPECT_W:0] stretched = $signed({1'b0, size_squared}) * $signed({1'b0, aspect});
      fit #(.IN_W(SIZE_SQUARED_W + ASPECT_W + 1), .PLACES(machine_pkg::VIEW_ASPECT_F), .W(SIZE_SQUARED_W), .S(0),
          .ROUND(machine_pkg::ELLIPSE_SIZE_SQUARED_ROUND), .WRAP(machine_pkg::ELLIPSE_SIZE_SQUARED_WRAP))
          fit_stretched (.exact(stretched), .word(sizes_squared[i*SIZE_SQUARED_W+:SIZE_SQUARED_W]));
    end
  end else begin : g_square
    assign sizes_squared = {3{size_squared}};
  end
endmodule

`default_nettype wire
