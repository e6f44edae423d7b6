// Blank: outputs the tiles without entries: the background at each of their pixels, one word per
// cycle. RTL implementation of `write_empty` in timing/binned.rs.
//
//   tiles in order -> those without an entry -> pixels ->( resolve of nothing )-> words
`timescale 1ns / 1ps
`default_nettype none

module blank #(
    parameter int COLUMNS = 1, // tiles of a row
    parameter int ROWS = 1,    // rows of them
    parameter int SIDE = 16    // columns and rows of a tile, a power of two
) (
    input wire clk,                                     // clock, rising edge
    input wire rst,                                     // restarts
    input wire [machine_pkg::FRAME_W-1:0] frame,        // constants: the background
    input wire drawing,                                 // lists are complete; when it falls, the next picture begins
    input wire [COLUMNS*ROWS-1:0] empty,                // tiles that have no entry
    output wire done,                                   // resolve has taken all of them, until `drawing` falls
    output wire m_valid,                                // a pixel is offered
    input wire m_ready,                                 // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data // pipeline.out
);
  localparam int X_W = machine_pkg::RASTER_OUT_X_W;
  localparam int Y_W = machine_pkg::RASTER_OUT_Y_W;
  localparam int TILES = COLUMNS * ROWS;
  localparam int TILE_W = $clog2(TILES + 1);

  logic [TILE_W-1:0] tile;
  logic [X_W-1:0] left, column;
  logic [Y_W-1:0] top, row;
  wire here, taken;
  assign done = drawing && tile == TILE_W'(TILES);
  assign here = drawing && !done && empty[tile];
  wire last_of_row = column == X_W'(SIDE - 1);
  wire last_of_tile = here ? taken && last_of_row && row == Y_W'(SIDE - 1) : !done;
  wire last_of_tiles = left == X_W'((COLUMNS - 1) * SIDE);
  always_ff @(posedge clk) begin
    if (rst || !drawing) begin
      tile <= '0;
      left <= '0;
      top <= '0;
      column <= '0;
      row <= '0;
    end else begin
      if (here && taken) begin
        column <= last_of_row ? '0 : column + X_W'(1);
        if (last_of_row) row <= last_of_tile ? '0 : row + Y_W'(1);
      end
      if (last_of_tile) begin
        tile <= tile + TILE_W'(1);
        left <= last_of_tiles ? '0 : left + X_W'(SIDE);
        if (last_of_tiles) top <= top + Y_W'(SIDE);
      end
    end
  end
  resolve resolve (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(here),
      .s_ready(taken),
      .s_data({left + column, top + row, 1'b1, 1'b1, machine_pkg::FRAGMENT_ANSWER_W'(0)}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
endmodule

`default_nettype wire
