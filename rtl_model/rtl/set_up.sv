// Set_up: the first half of the pipeline for discs: project and ellipse. RTL implementation of
// set_up in pipeline/set_up.rs.
//
//   splats -> project -> ellipse -> footprints
//
// A culled splat ends in the unit that culls it: it occupies no FIFO and no cycle of the next unit,
// as in the timing model. Fields that a unit does not need pass through it as its tag.
`timescale 1ns / 1ps
`default_nettype none

module set_up #(
    parameter ROMS = "rom/" // folder of the tables, with its slash
) (
    input wire clk,                                                            // clock, rising edge
    input wire rst,                                                            // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,                               // constants: the view
    input wire s_valid,                                                        // a splat is there
    output wire s_ready,                                                       // and can be taken
    input wire [machine_pkg::PIPELINE_IN_W-1:0] s_data,                        // pipeline.in
    output wire m_valid,                                                       // it is set up
    input wire m_ready,                                                        // and taken
    output wire [machine_pkg::PIPELINE_IN_RADIUS_LSB-1:0] m_look,              // fields after its radius in pipeline.in
    output wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] m_normal,               // its normal in camera space
    output wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] m_amplitude,            // its amplitude
    output wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] m_footprint,              // raster.in, but for the tag
    output wire quiet                                                          // no record is offered here or between the units
);
  localparam int LOOK_W = machine_pkg::PIPELINE_IN_RADIUS_LSB;
  localparam int DISC_W = 3 * machine_pkg::SPLAT_NORMAL_W + machine_pkg::SPLAT_RADIUS_W;
  localparam int DEPTH_W = machine_pkg::PROJECT_DEPTH_W;
  localparam int PIXEL_W = 2 * machine_pkg::PROJECT_PIXEL_W;

  // Project.

  wire point_valid, point_taken;
  wire [machine_pkg::PROJECT_OUT_W-1:0] point;
  wire [DISC_W-1:0] disc;
  wire [LOOK_W-1:0] look;
  project #(.DROPS(1), .TAG_W(DISC_W + LOOK_W), .ROMS(ROMS)) project (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(s_valid),
      .s_ready(s_ready),
      .s_data({s_data[DISC_W+LOOK_W-1:0], s_data[machine_pkg::PIPELINE_IN_POSITION_Z_LSB+:machine_pkg::PROJECT_IN_W]}),
      .m_valid(point_valid),
      .m_ready(point_taken),
      .m_data({disc, look, point})
  );

  // Ellipse.

  wire [machine_pkg::ELLIPSE_OUT_W-1:0] ellipse_out;
  wire [DEPTH_W-1:0] depth;
  wire [PIXEL_W-1:0] pixel;
  ellipse #(.DROPS(1), .TAG_W(LOOK_W + DEPTH_W + PIXEL_W), .ROMS(ROMS)) ellipse (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(point_valid),
      .s_ready(point_taken),
      .s_data({
        look,
        point[machine_pkg::PROJECT_OUT_DEPTH_LSB+:DEPTH_W],
        point[machine_pkg::PROJECT_OUT_PIXEL_Y_LSB+:PIXEL_W],
        disc,
        point[machine_pkg::PROJECT_OUT_FORWARD_LSB+:machine_pkg::PROJECT_OUT_FORWARD_W],
        point[machine_pkg::PROJECT_OUT_EXPONENT_LSB+:machine_pkg::PROJECT_OUT_EXPONENT_W],
        point[machine_pkg::PROJECT_OUT_DEPTH_LSB-1:0]
      }),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data({m_look, depth, pixel, ellipse_out})
  );
  set_up_footprint ordered (
      .depth(depth), .pixel(pixel), .ellipse_out(ellipse_out), .normal(m_normal), .amplitude(m_amplitude), .footprint(m_footprint));

  assign quiet = !s_valid && !point_valid && !m_valid;

  // Splats after project are not culled: these bits are unused.
  wire unused = &{1'b0, point};
endmodule

`default_nettype wire
