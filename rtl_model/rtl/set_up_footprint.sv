// Set_up_footprint: the results of project and of ellipse, or ellipsoid, in the order of raster.in.
`timescale 1ns / 1ps
`default_nettype none

module set_up_footprint (
    input wire [machine_pkg::PROJECT_DEPTH_W-1:0] depth,             // the splat's depth
    input wire [2*machine_pkg::PROJECT_PIXEL_W-1:0] pixel,           // its centre in the picture
    input wire [machine_pkg::ELLIPSE_OUT_W-1:0] ellipse_out,         // ellipse.out
    output wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] normal,       // its normal in camera space
    output wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] amplitude,    // its amplitude
    output wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] footprint       // raster.in, but for the tag
);
  localparam int CONIC_W = 2 * machine_pkg::ELLIPSE_CONIC_W + machine_pkg::ELLIPSE_CONIC_CROSS_W;
  localparam int BOX_W = 2 * machine_pkg::RASTER_IN_FIRST_COLUMN_W + 2 * machine_pkg::RASTER_IN_FIRST_ROW_W;
  localparam int PLANE_W = 2 * machine_pkg::ELLIPSE_DEPTH_SLOPE_W + machine_pkg::ELLIPSE_DEPTH_RANGE_W;
  assign normal = ellipse_out[machine_pkg::ELLIPSE_OUT_NORMAL_Z_LSB+:3*machine_pkg::FRAGMENT_NORMAL_W];
  assign amplitude = ellipse_out[machine_pkg::ELLIPSE_OUT_AMPLITUDE_LSB+:machine_pkg::ELLIPSE_AMPLITUDE_W];
  assign footprint = {
    pixel,
    ellipse_out[machine_pkg::ELLIPSE_OUT_CONIC_YY_LSB+:CONIC_W],
    depth,
    ellipse_out[machine_pkg::ELLIPSE_OUT_DEPTH_RANGE_LSB+:PLANE_W],
    ellipse_out[machine_pkg::ELLIPSE_OUT_LAST_ROW_LSB+:BOX_W]
  };
  // It is not culled.
  wire unused = &{1'b0, ellipse_out};
endmodule

`default_nettype wire
