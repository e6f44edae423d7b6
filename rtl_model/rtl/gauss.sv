// Gauss: turns a radial index into a weight, amplitude * exp(-r/2), from one table. RTL
// implementation of units/gauss.rs.
//
//   radial ->( fit )-> radial_index ->[table]-> falloff ->(*)-> weight
//   amplitude ---------------------------------------------+
//
// Losses: the radial index is truncated to the table's argument; falloff and weight are rounded.
`timescale 1ns / 1ps
`default_nettype none

module gauss #(
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                         // clock, rising edge
    input wire rst,                                         // clears records in flight
    input wire [machine_pkg::GAUSS_WEIGHT_W-1:0] least,     // constant: the minimum weight; lower weights end here
    input wire s_valid,                                     // a fragment is there
    output wire s_ready,                                    // and can be taken
    input wire [TAG_W+machine_pkg::GAUSS_IN_W-1:0] s_data,  // the tag, gauss.in
    output wire m_valid,                                    // a weight is offered
    input wire m_ready,                                     // and taken
    output wire [TAG_W+machine_pkg::GAUSS_OUT_W-1:0] m_data // the tag, gauss.out
);
  localparam int RADIAL_W = machine_pkg::RASTER_RADIAL_W;
  localparam int INDEX_W = machine_pkg::GAUSS_RADIAL_INDEX_W;
  localparam int FALLOFF_W = machine_pkg::GAUSS_FALLOFF_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int WEIGHED_W = AMPLITUDE_W + FALLOFF_W;
  localparam int WEIGHT_W = machine_pkg::GAUSS_WEIGHT_W;

  // Never negative.
  wire signed [RADIAL_W-1:0] radial = s_data[machine_pkg::GAUSS_IN_RADIAL_LSB+:RADIAL_W];
  wire [AMPLITUDE_W-1:0] amplitude = s_data[machine_pkg::GAUSS_IN_AMPLITUDE_LSB+:AMPLITUDE_W];

  wire [INDEX_W-1:0] radial_index;
  fit #(.IN_W(RADIAL_W), .PLACES(machine_pkg::RASTER_RADIAL_F - machine_pkg::GAUSS_RADIAL_INDEX_F), .W(INDEX_W), .S(0),
      .ROUND(machine_pkg::GAUSS_RADIAL_INDEX_ROUND), .WRAP(machine_pkg::GAUSS_RADIAL_INDEX_WRAP))
      index (.exact(radial), .word(radial_index));

  wire [FALLOFF_W-1:0] falloff;
  lookup #(.ARGUMENT_W(INDEX_W), .TABLE_BITS(machine_pkg::GAUSS_TABLE_BITS), .LINEAR(machine_pkg::GAUSS_TABLE_LINEAR), .W(FALLOFF_W),
      .ROUND(machine_pkg::GAUSS_FALLOFF_ROUND), .ROM({ROMS, "gauss.table.hex"})) exponential (.argument(radial_index), .word(falloff));

  wire [WEIGHED_W-1:0] weighed = amplitude * falloff;
  wire [WEIGHT_W-1:0] weight;
  fit #(.IN_W(WEIGHED_W + 1), .PLACES(machine_pkg::ELLIPSE_AMPLITUDE_F + machine_pkg::GAUSS_FALLOFF_F - machine_pkg::GAUSS_WEIGHT_F),
      .W(WEIGHT_W), .S(0), .ROUND(machine_pkg::GAUSS_WEIGHT_ROUND), .WRAP(machine_pkg::GAUSS_WEIGHT_WRAP))
      weigher (.exact($signed({1'b0, weighed})), .word(weight));

  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::GAUSS_OUT_W;
  wire keeps = weight >= least;
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::GAUSS_IN_W, weight});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::GAUSS_LATENCY), .INTERVAL(machine_pkg::GAUSS_INTERVAL), .ROOM(machine_pkg::GAUSS_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(keeps), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));
endmodule

`default_nettype wire
