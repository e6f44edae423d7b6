// Engine: draws tiles, one after the other. Its list reads the entries of a tile, and fill draws
// the part of each splat that is in the tile. RTL implementation of an engine in timing/binned.rs,
// with one tile buffer.
//
//   tile -> list -> entries ->( fill )-> words
//
// The list continues with the next tile after the last entry of this one, while there are places
// for entries. These stay in the FIFO until this tile is finished and its pixels are output. A tile
// is finished when no record was offered for a number of cycles (silence).
`timescale 1ns / 1ps
`default_nettype none

module engine #(
    parameter int SIDE = 16,    // columns and rows of a tile, a power of two
    parameter int LISTED = 17,  // entries in the FIFO before raster
    parameter int RECORD_W = 1, // bits of a record: look, normal, amplitude, raster.in but for the tag
    parameter int TILE_W = 1,   // bits of a tile's number
    parameter int LENGTH_W = 1, // bits of a list's length
    parameter ROMS = "rom/"     // folder of the tables, with its slash
) (
    input wire clk,                                               // clock, rising edge
    input wire rst,                                               // empties everything
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constants: the view
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,           // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,     // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections, // constants: a record for each light of each material
    output wire t_ready,                                          // it can take a tile
    input wire t_valid,                                           // a tile is offered
    input wire [TILE_W-1:0] t_tile,                               // its number
    input wire [machine_pkg::RASTER_OUT_X_W+machine_pkg::RASTER_OUT_Y_W-1:0] t_corner, // its first column and row
    input wire [LENGTH_W-1:0] t_length,                           // entries of its list
    output wire [TILE_W-1:0] r_tile,                              // tile to read
    output wire [LENGTH_W-1:0] r_entry,                           // entry to read
    input wire [RECORD_W-1:0] r_data,                             // its record, in the same cycle
    output wire idle,                                             // it has nothing to draw, and has output everything
    output wire m_valid,                                          // a pixel is offered
    input wire m_ready,                                           // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data          // pipeline.out
);
  localparam int X_W = machine_pkg::RASTER_OUT_X_W;
  localparam int Y_W = machine_pkg::RASTER_OUT_Y_W;
  localparam int LOOK_W = machine_pkg::PIPELINE_IN_RADIUS_LSB;
  localparam int NORMAL_W = 3 * machine_pkg::FRAGMENT_NORMAL_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int FOOTPRINT_W = machine_pkg::RASTER_IN_TAG_LSB;

  // List: one entry per cycle. Tiles without entries do not come here.

  logic has_tile;
  logic [TILE_W-1:0] tile;
  logic [X_W+Y_W-1:0] tile_corner;
  logic [LENGTH_W-1:0] length, nth;
  wire is_last = nth + LENGTH_W'(1) == length;
  wire room, entry_valid, entry_ready, entry_last;
  wire [X_W+Y_W-1:0] entry_corner;
  wire [RECORD_W-1:0] entry;
  wire take = has_tile && room;
  assign t_ready = !has_tile || take && is_last;
  assign r_tile = tile;
  assign r_entry = nth;
  always_ff @(posedge clk) begin
    has_tile <= !rst && (t_valid && t_ready || has_tile && !(take && is_last));
    if (t_valid && t_ready) begin
      tile <= t_tile;
      tile_corner <= t_corner;
      length <= t_length;
      nth <= '0;
    end else if (take) nth <= nth + LENGTH_W'(1);
  end
  pipe #(
      .W(1 + X_W + Y_W + RECORD_W),
      .LATENCY(1),
      .INTERVAL(1),
      .ROOM(LISTED)
  ) listed (
      .clk(clk),
      .rst(rst),
      .s_valid(has_tile),
      .s_ready(room),
      .s_keeps(1'b1),
      .s_data({is_last, tile_corner, r_data}),
      .m_valid(entry_valid),
      .m_ready(entry_ready),
      .m_data({entry_last, entry_corner, entry})
  );

  // Fill: the entries of one tile. The pixels of a tile are output after its last entry and before
  // the first entry of the next tile.

  logic ends;
  logic [X_W+Y_W-1:0] corner_was;
  wire fill_ready, quiet, silent, drained;
  assign entry_ready = !ends && fill_ready;
  wire drain = ends && silent;
  // Entries behind the last one of a tile belong to another tile.
  wire [X_W+Y_W-1:0] corner = entry_valid && !ends ? entry_corner : corner_was;
  always_ff @(posedge clk) begin
    ends <= !rst && (entry_valid && entry_ready && entry_last || ends && !(drain && drained));
    corner_was <= corner;
  end
  fill #(.WIDTH(SIDE), .HEIGHT(SIDE), .SIDE(SIDE), .ROMS(ROMS)) fill (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .corner(corner),
      .s_valid(entry_valid && !ends),
      .s_ready(fill_ready),
      .s_look(entry[RECORD_W-1-:LOOK_W]),
      .s_normal(entry[FOOTPRINT_W+AMPLITUDE_W+:NORMAL_W]),
      .s_amplitude(entry[FOOTPRINT_W+:AMPLITUDE_W]),
      .s_footprint(entry[FOOTPRINT_W-1:0]),
      .quiet(quiet),
      .drain(drain),
      .drained(drained),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  silence silence (.clk(clk), .rst(rst), .quiet(quiet), .silent(silent));
  assign idle = !has_tile && !entry_valid && !ends;
endmodule

`default_nettype wire
