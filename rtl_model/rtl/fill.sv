// Fill: the second half of the pipeline for fragments grouped by depth: raster, gauss, fragment,
// shade and resolve. RTL implementation of fill in pipeline/fill.rs, for a picture, or a tile of
// one, whose fragments all fit on the chip.
//
//   footprints -> raster -> gauss -> fragment -+-> layers -> resolve -> frame
//                                     +--> shade <--+
//
// After the last splat, `drain` outputs the contents of all pixels, pixel by pixel.
`timescale 1ns / 1ps
`default_nettype none

module fill #(
    parameter int WIDTH = 16,  // columns of the picture, or of a tile
    parameter int HEIGHT = 16, // and its rows
    parameter int SIDE = 0,    // of a tile: both; 0 of a picture
    parameter ROMS = "rom/"    // folder of the tables, with its slash
) (
    input wire clk,                                                // clock, rising edge
    input wire rst,                                                // empties everything
    input wire [machine_pkg::FRAME_W-1:0] frame,                   // constants: the view
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,            // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,      // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections,  // constants: a record for each light of each material
    input wire [machine_pkg::RASTER_OUT_X_W+machine_pkg::RASTER_OUT_Y_W-1:0] corner, // of a tile: its first column and row, while it is drawn
    input wire s_valid,                                            // a splat is set up
    output wire s_ready,                                           // and can be taken
    input wire [3*machine_pkg::SPLAT_RGB_W+machine_pkg::SPLAT_OPACITY_W+machine_pkg::PIPELINE_IN_MATERIAL_W-1:0] s_look, // its appearance
    input wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] s_normal,    // its normal in camera space
    input wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] s_amplitude, // its amplitude
    input wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] s_footprint,   // raster.in, but for the tag
    output wire quiet,                                             // no record is offered before fragment, and no box is walked
    input wire drain,                                              // the last splat was taken and none is in flight: output the picture
    output wire drained,                                           // resolve has taken everything, until drain falls
    output wire m_valid,                                           // a pixel is offered
    input wire m_ready,                                            // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data           // pipeline.out
);
  localparam int RGBA_W = 3 * machine_pkg::SPLAT_RGB_W + machine_pkg::SPLAT_OPACITY_W;
  localparam int MATERIAL_W = machine_pkg::PIPELINE_IN_MATERIAL_W;
  localparam int NORMAL_W = 3 * machine_pkg::FRAGMENT_NORMAL_W;
  localparam int X_W = machine_pkg::RASTER_OUT_X_W;
  localparam int Y_W = machine_pkg::RASTER_OUT_Y_W;

  // Raster and gauss: contributions of weight 0 are dropped.

  wire weight_valid, weight_taken;
  wire [RGBA_W-1:0] rgba;
  wire [MATERIAL_W-1:0] material;
  wire [NORMAL_W-1:0] normal;
  wire [X_W+Y_W-1:0] pixel;
  wire [machine_pkg::GAUSS_WEIGHT_W-1:0] weight;
  wire [machine_pkg::RASTER_OUT_DEPTH_W-1:0] depth;
  weigh #(.TAG_W(RGBA_W + MATERIAL_W + NORMAL_W), .SIDE(SIDE), .ROMS(ROMS)) weigh (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .least(machine_pkg::GAUSS_WEIGHT_W'(1)),
      .corner(corner),
      .s_valid(s_valid),
      .s_ready(s_ready),
      .s_tag({s_look, s_normal}),
      .s_amplitude(s_amplitude),
      .s_footprint(s_footprint),
      .m_valid(weight_valid),
      .m_ready(weight_taken),
      .m_tag({rgba, material, normal}),
      .m_pixel(pixel),
      .m_weight(weight),
      .m_depth(depth),
      .quiet(quiet)
  );

  // Fragment.

  wire asks, asked, answered, answer_ready;
  wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] request;
  wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] light;
  wire held_valid, held_ready, held_last, held_empty;
  wire [machine_pkg::FRAGMENT_HELD_W-1:0] held;
  wire all_held;
  // Pixels are numbered within the tile. The outcomes of contributions are not used here.
  // verilator lint_off PINCONNECTEMPTY
  fragment #(.WIDTH(WIDTH), .HEIGHT(HEIGHT)) fragment (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(weight_valid),
      .s_ready(weight_taken),
      .s_data({pixel ^ corner, weight, depth, rgba, normal, material}),
      .m_valid(),
      .m_ready(1'b1),
      .m_data(),
      .q_valid(asks),
      .q_ready(asked),
      .q_data(request),
      .a_valid(answered),
      .a_ready(answer_ready),
      .a_data(light),
      .drain(drain),
      .drained(all_held),
      .h_valid(held_valid),
      .h_ready(held_ready),
      .h_last(held_last),
      .h_empty(held_empty),
      .h_data(held)
  );
  // verilator lint_on PINCONNECTEMPTY

  // Layers: the contents of a pixel, shaded if they were not yet. Fragment uses shade until the
  // output begins.

  localparam int LIGHT_W = machine_pkg::FRAGMENT_ANSWER_W;
  localparam int LAYER_W = X_W + Y_W + 2;
  wire [X_W+Y_W-1:0] held_pixel = held[machine_pkg::FRAGMENT_HELD_Y_LSB+:X_W+Y_W] ^ corner;
  wire [LAYER_W-1:0] layer = {held_pixel, held_last, held_empty};
  wire held_shaded = held[machine_pkg::FRAGMENT_HELD_SHADED_LSB];
  wire held_dark = !held_empty && !held_shaded;
  wire [LIGHT_W-1:0] held_light = held_empty ? '0 : held[machine_pkg::FRAGMENT_HELD_LIT_OPACITY_LSB+:LIGHT_W];
  wire shade_ready, lit_valid, lit_ready;
  wire layers_full, layers_empty;
  wire dark_asks = held_valid && held_dark && !layers_full;
  wire layer_ready;
  wire layer_dark;
  wire [LAYER_W-1:0] layer_out;
  wire [LIGHT_W-1:0] layer_light;
  assign held_ready = !layers_full && (!held_dark || shade_ready);
  fifo #(.W(LAYER_W + 1 + LIGHT_W), .PLACES(machine_pkg::SHADE_ROOM)) layers (
      .clk(clk),
      .rst(rst),
      .push(held_valid && held_ready),
      .s_data({layer, held_dark, held_light}),
      .pop(layer_ready && !layers_empty && (!layer_dark || lit_valid)),
      .m_data({layer_out, layer_dark, layer_light}),
      .empty(layers_empty),
      .full(layers_full)
  );

  // Shade.

  localparam int ASKED_W = machine_pkg::FRAGMENT_REQUEST_WEIGHT_LSB + machine_pkg::FRAGMENT_REQUEST_WEIGHT_W;
  localparam int SUMS_W = ASKED_W - MATERIAL_W;
  // The uppermost bits are unused if a request has no pixel.
  wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] dark = machine_pkg::FRAGMENT_REQUEST_W'({
    held_pixel,
    held[machine_pkg::FRAGMENT_HELD_NORMAL_Z_LSB+:SUMS_W],
    held[machine_pkg::FRAGMENT_HELD_MATERIAL_LSB+:MATERIAL_W]
  });
  wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] request_here = request ^ machine_pkg::FRAGMENT_REQUEST_W'({corner, ASKED_W'(0)});
  assign asked = shade_ready;
  assign answered = lit_valid && layers_empty;
  assign lit_ready = layers_empty ? answer_ready : layer_dark && layer_ready;
  shade #(.ROMS(ROMS)) shade (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .s_valid(asks || dark_asks),
      .s_ready(shade_ready),
      .s_data(asks ? request_here : dark),
      .m_valid(lit_valid),
      .m_ready(lit_ready),
      .m_data(light)
  );

  // Resolve.

  resolve resolve (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(!layers_empty && (!layer_dark || lit_valid)),
      .s_ready(layer_ready),
      .s_data({layer_out, layer_dark ? light : layer_light}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  assign drained = all_held && layers_empty;
endmodule

`default_nettype wire
