// Bin: appends a splat that is set up to the list of every tile that its box touches. It takes one
// cycle for the record, then one cycle per entry. RTL implementation of `first_pass` in
// timing/binned.rs; Bins in work/mod.rs has the same lists.
//
//   splats -> records          box -> tiles, row by row -> lists
//
// Records and lists are in memory, which does not stall here. The reader of an entry also reads its
// record.
`timescale 1ns / 1ps
`default_nettype none

module bin #(
    parameter int COLUMNS = 1,    // tiles of a row
    parameter int ROWS = 1,       // rows of them
    parameter int SIDE_BITS = 4,  // log2 of a tile's side in pixels
    parameter int RECORDS = 1,    // capacity of memory, splats
    parameter int RECORD_W = 1,   // bits of a record, the box in the low ones
    parameter int READERS = 1,    // number of readers
    parameter int TILE_W = 1,     // bits of a tile's number
    parameter int LENGTH_W = 1    // bits of a list's length
) (
    input wire clk,                                  // clock, rising edge
    input wire rst,                                  // empties all lists
    input wire s_valid,                              // a splat is there
    output wire s_ready,                             // and is taken
    input wire [RECORD_W-1:0] s_data,                // its record
    output wire [COLUMNS*ROWS*LENGTH_W-1:0] lengths, // entries of each tile
    input wire [READERS*TILE_W-1:0] r_tile,          // tile to read
    input wire [READERS*LENGTH_W-1:0] r_entry,       // entry to read
    output wire [READERS*RECORD_W-1:0] r_data        // its record
);
  localparam int TILES = COLUMNS * ROWS;
  localparam int INDEX_W = RECORDS > 1 ? $clog2(RECORDS) : 1;
  localparam int ADDRESS_W = TILES * RECORDS > 1 ? $clog2(TILES * RECORDS) : 1;
  localparam int COLUMN_W = machine_pkg::RASTER_IN_FIRST_COLUMN_W;
  localparam int ROW_W = machine_pkg::RASTER_IN_FIRST_ROW_W;

  function automatic [ADDRESS_W-1:0] address(input [TILE_W-1:0] tile, input [LENGTH_W-1:0] entry);
    address = ADDRESS_W'((TILE_W + LENGTH_W)'(tile) * (TILE_W + LENGTH_W)'(RECORDS) + (TILE_W + LENGTH_W)'(entry));
  endfunction

  logic [RECORD_W-1:0] records[0:RECORDS-1];
  logic [INDEX_W-1:0] lists[0:TILES*RECORDS-1];

  // The tiles of a box, row by row.
  logic [LENGTH_W-1:0] count;
  logic walking;
  logic [INDEX_W-1:0] index;
  logic [COLUMN_W-1:0] column, first_column, last_column;
  logic [ROW_W-1:0] row, last_row;
  wire take = s_valid && s_ready;
  assign s_ready = !walking;
  wire [TILE_W-1:0] tile = TILE_W'(row) * TILE_W'(COLUMNS) + TILE_W'(column);
  wire last_of_row = column == last_column;
  always_ff @(posedge clk) begin
    if (rst) begin
      count <= '0;
      walking <= 1'b0;
    end else begin
      if (take) count <= count + LENGTH_W'(1);
      walking <= take || walking && !(last_of_row && row == last_row);
    end
    if (take) begin
      records[INDEX_W'(count)] <= s_data;
      index <= INDEX_W'(count);
      column <= s_data[machine_pkg::RASTER_IN_FIRST_COLUMN_LSB+:COLUMN_W] >> SIDE_BITS;
      first_column <= s_data[machine_pkg::RASTER_IN_FIRST_COLUMN_LSB+:COLUMN_W] >> SIDE_BITS;
      last_column <= s_data[machine_pkg::RASTER_IN_LAST_COLUMN_LSB+:COLUMN_W] >> SIDE_BITS;
      row <= s_data[machine_pkg::RASTER_IN_FIRST_ROW_LSB+:ROW_W] >> SIDE_BITS;
      last_row <= s_data[machine_pkg::RASTER_IN_LAST_ROW_LSB+:ROW_W] >> SIDE_BITS;
    end else if (walking) begin
      lists[address(tile, lengths[tile*LENGTH_W+:LENGTH_W])] <= index;
      column <= last_of_row ? first_column : column + COLUMN_W'(1);
      row <= last_of_row ? row + ROW_W'(1) : row;
    end
  end
  for (genvar of = 0; of < TILES; of++) begin : g_tile
    logic [LENGTH_W-1:0] entries;
    always_ff @(posedge clk) begin
      if (rst) entries <= '0;
      else if (walking && tile == TILE_W'(of)) entries <= entries + LENGTH_W'(1);
    end
    assign lengths[of*LENGTH_W+:LENGTH_W] = entries;
  end

  for (genvar reader = 0; reader < READERS; reader++) begin : g_reader
    assign r_data[reader*RECORD_W+:RECORD_W] = records[lists[address(r_tile[reader*TILE_W+:TILE_W], r_entry[reader*LENGTH_W+:LENGTH_W])]];
  end
endmodule

`default_nettype wire
