// Emission: replaces a splat's colour by its light, before it is drawn. RTL implementation of
// Lit::emission in pipeline/set_up.rs.
//
//   rgb, normal, material ->[ fit ]-> sums ->( shade )-> light ->[ fit ]-> rgb
//
// The request to shade is an opaque fragment of weight 1. If splats are not shaded before they are
// drawn, they pass through.
//
// Losses: the request is rounded to a fragment's sums, the light to a splat's colour.
`timescale 1ns / 1ps
`default_nettype none

module emission #(
    parameter int TAG_W = 1, // bits of the data that passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                                // clock, rising edge
    input wire rst,                                                // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,                   // constants: whether splats are lit before they are drawn
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,            // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,      // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections,  // constants: a record for each light of each material
    input wire s_valid,                                            // a splat is set up
    output wire s_ready,                                           // and can be taken
    input wire [TAG_W-1:0] s_tag,                                  // passes through
    input wire [3*machine_pkg::SPLAT_RGB_W-1:0] s_rgb,             // its colour
    input wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] s_normal,    // its normal in camera space
    input wire [machine_pkg::PIPELINE_IN_MATERIAL_W-1:0] s_material, // its material
    output wire m_valid,                                           // it is offered
    input wire m_ready,                                            // and taken
    output wire [TAG_W-1:0] m_tag,                                 // s_tag of the same splat
    output wire [3*machine_pkg::SPLAT_RGB_W-1:0] m_rgb             // the colour that it sends
);
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int RGB_F = machine_pkg::SPLAT_RGB_F;
  localparam int NORMAL_W = machine_pkg::FRAGMENT_NORMAL_W;
  localparam int NORMAL_F = machine_pkg::FRAGMENT_NORMAL_F;
  localparam int WEIGHT_SUM_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int COLOUR_SUM_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_SUM_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int NORMAL_SUM_W = machine_pkg::FRAGMENT_NORMAL_SUM_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam [WEIGHT_SUM_W-1:0] WEIGHT_ONE = WEIGHT_SUM_W'(1) << machine_pkg::FRAGMENT_WEIGHT_SUM_F;
  localparam [OPACITY_SUM_W-1:0] OPACITY_ONE = OPACITY_SUM_W'(1) << machine_pkg::FRAGMENT_OPACITY_SUM_F;

  // Channels and components are packed as in a record: blue, and z, in the low bits.
  wire [3*COLOUR_SUM_W-1:0] colours;
  wire [3*NORMAL_SUM_W-1:0] normals;
  wire [3*RGB_W-1:0] sent;
  wire [4*LIGHT_W-1:0] light;
  for (genvar i = 0; i < 3; i++) begin : g_channel
    fit #(.IN_W(RGB_W + 1), .PLACES(RGB_F - machine_pkg::FRAGMENT_COLOUR_SUM_F), .W(COLOUR_SUM_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S), .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND), .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP))
        fit_colour (.exact($signed({1'b0, s_rgb[i*RGB_W+:RGB_W]})), .word(colours[i*COLOUR_SUM_W+:COLOUR_SUM_W]));
    fit #(.IN_W(NORMAL_W), .PLACES(NORMAL_F - machine_pkg::FRAGMENT_NORMAL_SUM_F), .W(NORMAL_SUM_W),
        .S(machine_pkg::FRAGMENT_NORMAL_SUM_S), .ROUND(machine_pkg::FRAGMENT_NORMAL_SUM_ROUND), .WRAP(machine_pkg::FRAGMENT_NORMAL_SUM_WRAP))
        fit_normal (.exact($signed(s_normal[i*NORMAL_W+:NORMAL_W])), .word(normals[i*NORMAL_SUM_W+:NORMAL_SUM_W]));
    fit #(.IN_W(LIGHT_W + 1), .PLACES(machine_pkg::SHADE_PREMULTIPLIED_F - RGB_F), .W(RGB_W), .S(machine_pkg::SPLAT_RGB_S),
        .ROUND(machine_pkg::SPLAT_RGB_ROUND), .WRAP(machine_pkg::SPLAT_RGB_WRAP))
        fit_sent (.exact($signed({1'b0, light[(i+1)*LIGHT_W+:LIGHT_W]})), .word(sent[i*RGB_W+:RGB_W]));
  end

  wire preshaded = frame[machine_pkg::FRAME_PRESHADED_LSB];
  wire shade_ready, shade_valid;
  wire [TAG_W-1:0] tag;
  shade #(.TAG_W(TAG_W), .ROMS(ROMS)) shade (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .s_valid(s_valid && preshaded),
      .s_ready(shade_ready),
      .s_data({s_tag, WEIGHT_ONE, colours, OPACITY_ONE, normals, s_material}),
      .m_valid(shade_valid),
      .m_ready(m_ready && preshaded),
      .m_data({tag, light})
  );
  assign s_ready = preshaded ? shade_ready : m_ready;
  assign m_valid = preshaded ? shade_valid : s_valid;
  assign {m_tag, m_rgb} = preshaded ? {tag, sent} : {s_tag, s_rgb};

  // The requested fragment was opaque.
  wire unused = &{1'b0, light[LIGHT_W-1:0]};
endmodule

`default_nettype wire
