// Pipeline_sheets: connects the units, for ellipsoids whose fragments are grouped by sheets:
// volumes and Gaussians. RTL implementation of pipeline/mod.rs, for a picture whose pixels all fit
// on the chip.
//
//   splats ->( set_up_ellipsoids: project -> ellipsoid )->( emission )->( weigh: raster -> gauss )-> sheets -> resolve -> frame
//                                                            +-> shade
//
// Splats are input one after the other, in drawing order: they are not sorted here, so splats that
// are sorted by depth are sorted before. After the last one, `drain` outputs the contents of all
// pixels, pixel by pixel.
`timescale 1ns / 1ps
`default_nettype none

module pipeline_sheets #(
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
  localparam int RGB_W = 3 * machine_pkg::SPLAT_RGB_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int FOOTPRINT_W = machine_pkg::RASTER_IN_TAG_LSB;
  localparam int SHEET_W = machine_pkg::PIPELINE_IN_SHEET_W;
  localparam int WEIGHT_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int PIXEL_W = machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W;

  // Project and ellipsoid.

  wire splat_valid, splat_taken;
  wire [machine_pkg::PIPELINE_IN_SCALE_2_LSB-1:0] look;
  wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] normal;
  wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] amplitude;
  wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] footprint;
  wire set_up_quiet, weigh_quiet, silent;
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

  // Emission: the shaded colours of voxels.

  wire lit_valid, lit_taken;
  wire [SHEET_W-1:0] lit_sheet;
  wire [AMPLITUDE_W-1:0] lit_amplitude;
  wire [FOOTPRINT_W-1:0] lit_footprint;
  wire [RGB_W-1:0] lit_rgb;
  emission #(.TAG_W(SHEET_W + AMPLITUDE_W + FOOTPRINT_W), .ROMS(ROMS)) emission (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .s_valid(splat_valid),
      .s_ready(splat_taken),
      .s_tag({look[machine_pkg::PIPELINE_IN_SHEET_LSB+:SHEET_W], amplitude, footprint}),
      .s_rgb(look[machine_pkg::PIPELINE_IN_BLUE_LSB+:RGB_W]),
      .s_normal(normal),
      .s_material(look[machine_pkg::PIPELINE_IN_MATERIAL_LSB+:machine_pkg::PIPELINE_IN_MATERIAL_W]),
      .m_valid(lit_valid),
      .m_ready(lit_taken),
      .m_tag({lit_sheet, lit_amplitude, lit_footprint}),
      .m_rgb(lit_rgb)
  );

  // Raster and gauss: the frame has the minimum weight, and a weight of 0 is always dropped.

  wire [WEIGHT_W-1:0] some_least = frame[machine_pkg::FRAME_LEAST_WEIGHT_LSB+:WEIGHT_W];
  wire weight_valid, weight_taken;
  wire [SHEET_W-1:0] sheet;
  wire [RGB_W-1:0] rgb;
  wire [PIXEL_W-1:0] pixel;
  wire [WEIGHT_W-1:0] weight;
  // A sheet has no depth.
  wire [machine_pkg::RASTER_OUT_DEPTH_W-1:0] unused_depth;
  weigh #(.TAG_W(SHEET_W + RGB_W), .ROMS(ROMS)) weigh (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .least(some_least == '0 ? WEIGHT_W'(1) : some_least),
      .corner({(machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W) {1'b0}}),
      .s_valid(lit_valid),
      .s_ready(lit_taken),
      .s_tag({lit_sheet, lit_rgb}),
      .s_amplitude(lit_amplitude),
      .s_footprint(lit_footprint),
      .m_valid(weight_valid),
      .m_ready(weight_taken),
      .m_tag({sheet, rgb}),
      .m_pixel(pixel),
      .m_weight(weight),
      .m_depth(unused_depth),
      .quiet(weigh_quiet)
  );
  silence silence (.clk(clk), .rst(rst), .quiet(set_up_quiet && weigh_quiet), .silent(silent));

  // Sheets.

  wire held_valid, held_ready, held_empty;
  wire [machine_pkg::FRAGMENT_HELD_W-1:0] held;
  // The outcomes of contributions are not used here.
  // verilator lint_off PINCONNECTEMPTY
  sheets #(.WIDTH(WIDTH), .HEIGHT(HEIGHT), .ROMS(ROMS)) sheets (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(weight_valid),
      .s_ready(weight_taken),
      .s_data({pixel, weight, sheet, rgb}),
      .m_valid(),
      .m_ready(1'b1),
      .m_data(),
      .drain(drain && silent),
      .drained(drained),
      .h_valid(held_valid),
      .h_ready(held_ready),
      .h_empty(held_empty),
      .h_data(held)
  );
  // verilator lint_on PINCONNECTEMPTY

  // Resolve: the content of a pixel is its only layer.

  localparam int LIGHT_W = 4 * machine_pkg::SHADE_PREMULTIPLIED_W;
  resolve resolve (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(held_valid),
      .s_ready(held_ready),
      .s_data({
        held[machine_pkg::FRAGMENT_HELD_Y_LSB+:PIXEL_W],
        1'b1,
        held_empty,
        held_empty ? LIGHT_W'(0) : held[machine_pkg::FRAGMENT_HELD_LIT_OPACITY_LSB+:LIGHT_W]
      }),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );

  // Other fields of the content, and a splat's opacity, which ellipsoid has used.
  wire unused = &{1'b0, held, look};
endmodule

`default_nettype wire
