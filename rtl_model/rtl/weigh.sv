// Weigh: raster and gauss: the weight of a splat at each pixel.
//
//   footprints -> raster -> gauss -> contributions
//
// Weights below the minimum end in gauss.
`timescale 1ns / 1ps
`default_nettype none

module weigh #(
    parameter int TAG_W = 1, // bits of the data that passes through
    parameter int SIDE = 0,  // columns and rows of a tile; 0: boxes are not clipped
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                                // clock, rising edge
    input wire rst,                                                // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,                   // constants: the picture's size, the cutoff
    input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] least,            // constant: the minimum weight
    input wire [machine_pkg::RASTER_OUT_X_W+machine_pkg::RASTER_OUT_Y_W-1:0] corner, // of a tile: its first column and row, while it is drawn
    input wire s_valid,                                            // a splat is there
    output wire s_ready,                                           // and can be taken
    input wire [TAG_W-1:0] s_tag,                                  // passes through
    input wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] s_amplitude, // its amplitude
    input wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] s_footprint,   // raster.in, but for the tag
    output wire m_valid,                                           // a contribution is offered
    input wire m_ready,                                            // and taken
    output wire [TAG_W-1:0] m_tag,                                 // s_tag of the same splat
    output wire [machine_pkg::RASTER_OUT_X_W+machine_pkg::RASTER_OUT_Y_W-1:0] m_pixel, // its pixel
    output wire [machine_pkg::GAUSS_WEIGHT_W-1:0] m_weight,        // its weight
    output wire [machine_pkg::RASTER_OUT_DEPTH_W-1:0] m_depth,     // its depth, exact
    output wire quiet                                              // no record is offered here or between the units, and no box is walked
);
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int PIXEL_W = machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W;
  localparam int DEPTH_W = machine_pkg::RASTER_OUT_DEPTH_W;

  // Raster.

  wire fragment_valid, fragment_taken;
  wire [TAG_W-1:0] tag;
  wire [AMPLITUDE_W-1:0] amplitude;
  wire [PIXEL_W-1:0] pixel;
  wire [machine_pkg::RASTER_RADIAL_W-1:0] radial;
  wire [DEPTH_W-1:0] depth;
  raster #(.TAG_W(TAG_W + AMPLITUDE_W), .SIDE(SIDE)) raster (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .corner(corner),
      .s_valid(s_valid),
      .s_ready(s_ready),
      .s_data({s_tag, s_amplitude, s_footprint}),
      .m_valid(fragment_valid),
      .m_ready(fragment_taken),
      .m_data({tag, amplitude, pixel, radial, depth})
  );

  // Gauss.

  gauss #(.TAG_W(TAG_W + PIXEL_W + DEPTH_W), .ROMS(ROMS)) gauss (
      .clk(clk),
      .rst(rst),
      .least(least),
      .s_valid(fragment_valid),
      .s_ready(fragment_taken),
      .s_data({tag, pixel, depth, radial, amplitude}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data({m_tag, m_pixel, m_depth, m_weight})
  );

  // Raster takes no splat during a walk.
  assign quiet = !s_valid && s_ready && !fragment_valid && !m_valid;
endmodule

`default_nettype wire
