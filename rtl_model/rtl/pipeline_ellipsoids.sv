// Pipeline_ellipsoids: connects the units, for ellipsoids whose fragments are grouped by depth,
// such as those of a surface in a volume. RTL implementation of pipeline/mod.rs, for a picture
// whose fragments all fit on the chip.
//
//   splats ->( set_up_ellipsoids: project -> ellipsoid )->( fill: raster -> gauss -> fragment -> resolve )-> frame
//                                                                                      +-> shade <-+
//
// Splats are input one after the other. After the last one, `drain` outputs the contents of all
// pixels, pixel by pixel.
`timescale 1ns / 1ps
`default_nettype none

module pipeline_ellipsoids #(
    parameter int WIDTH = 16,  // columns of the picture
    parameter int HEIGHT = 16, // rows of the picture
    parameter ROMS = "rom/"    // folder of the tables, with its slash
) (
    input wire clk,                                               // clock, rising edge
    input wire rst,                                               // empties everything
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constants: the view
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,           // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,     // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections, // constants: a record for each light of each material
    input wire s_valid,                                           // a splat is there
    output wire s_ready,                                          // and can be taken
    input wire [machine_pkg::PIPELINE_IN_W-1:0] s_data,           // pipeline.in
    input wire drain,                                             // the last splat was taken: output the picture
    output wire drained,                                          // resolve has taken everything, until drain falls
    output wire m_valid,                                          // a pixel is offered
    input wire m_ready,                                           // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data          // pipeline.out
);
  wire splat_valid, splat_taken;
  wire [machine_pkg::PIPELINE_IN_SCALE_2_LSB-1:0] look;
  wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] normal;
  wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] amplitude;
  wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] footprint;
  wire set_up_quiet, fill_quiet, silent;
  set_up_ellipsoids #(.ROMS(ROMS)) set_up (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(s_valid),
      .s_ready(s_ready),
      .s_data(s_data),
      .m_valid(splat_valid),
      .m_ready(splat_taken),
      .m_look(look),
      .m_normal(normal),
      .m_amplitude(amplitude),
      .m_footprint(footprint),
      .quiet(set_up_quiet)
  );
  fill #(.WIDTH(WIDTH), .HEIGHT(HEIGHT), .ROMS(ROMS)) fill (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .corner({(machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W) {1'b0}}),
      .s_valid(splat_valid),
      .s_ready(splat_taken),
      .s_look(look),
      .s_normal(normal),
      .s_amplitude(amplitude),
      .s_footprint(footprint),
      .quiet(fill_quiet),
      .drain(drain && silent),
      .drained(drained),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  silence silence (.clk(clk), .rst(rst), .quiet(set_up_quiet && fill_quiet), .silent(silent));
endmodule

`default_nettype wire
