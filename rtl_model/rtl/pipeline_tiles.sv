// Pipeline_tiles: connects a binned machine for discs: first all splats are appended to lists, then
// tile engines take tiles from one queue. RTL implementation of timing/binned.rs, with one tile
// buffer and memory that never stalls.
//
//   splats ->( set_up )->( bin )-> lists          tiles in order -> queue -+->( engine )-+-> words, tile by tile
//                                                                          +->( engine )-+
//                                          those without an entry -------->( blank )-----+
//
// The second pass begins when the last splat is on its lists. The next tile goes to the engine
// whose list has read its last entry; among several, to the one with the lowest number. Tiles
// without entries are skipped by the queue, one per cycle.
`timescale 1ns / 1ps
`default_nettype none

module pipeline_tiles #(
    parameter int WIDTH = 16,        // columns of the picture, a multiple of SIDE
    parameter int HEIGHT = 16,       // and its rows
    parameter int ENGINES = 2,       // tile engines
    parameter int SIDE = 16,         // columns and rows of a tile, a power of two
    parameter int LISTED = 17,       // entries in an engine's FIFO
    parameter int RECORDS = 1 << 15, // capacity of memory, splats
    parameter ROMS = "rom/"          // folder of the tables, with its slash
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
    input wire drain,                                             // the last splat was taken: draw
    output wire drained,                                          // resolve has taken all tiles, until drain falls
    output wire m_valid,                                          // a pixel is offered
    input wire m_ready,                                           // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data          // pipeline.out
);
  localparam int X_W = machine_pkg::RASTER_OUT_X_W;
  localparam int Y_W = machine_pkg::RASTER_OUT_Y_W;
  localparam int COLUMNS = WIDTH / SIDE;
  localparam int ROWS = HEIGHT / SIDE;
  localparam int TILES = COLUMNS * ROWS;
  localparam int TILE_W = $clog2(TILES + 1);
  localparam int LENGTH_W = $clog2(RECORDS + 1);
  localparam int OUT_W = machine_pkg::PIPELINE_OUT_W;
  localparam int RECORD_W = machine_pkg::PIPELINE_IN_RADIUS_LSB + 3 * machine_pkg::FRAGMENT_NORMAL_W + machine_pkg::ELLIPSE_AMPLITUDE_W
      + machine_pkg::RASTER_IN_TAG_LSB;

  // The word that a one-hot vector selects.
  function automatic [OUT_W-1:0] picked(input [ENGINES:0] choice, input [(ENGINES+1)*OUT_W-1:0] all);
    integer at;
    begin
      picked = '0;
      for (at = 0; at <= ENGINES; at = at + 1) if (choice[at]) picked = picked | all[at*OUT_W+:OUT_W];
    end
  endfunction

  // The first pass.

  wire splat_valid, splat_taken, quiet, silent;
  wire [machine_pkg::PIPELINE_IN_RADIUS_LSB-1:0] look;
  wire [3*machine_pkg::FRAGMENT_NORMAL_W-1:0] normal;
  wire [machine_pkg::ELLIPSE_AMPLITUDE_W-1:0] amplitude;
  wire [machine_pkg::RASTER_IN_TAG_LSB-1:0] footprint;
  set_up #(.ROMS(ROMS)) set_up (
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
      .quiet(quiet)
  );
  logic drawing;
  wire all_listed = drain && silent && splat_taken;
  wire [TILES*LENGTH_W-1:0] lengths;
  wire [ENGINES*TILE_W-1:0] read_tile;
  wire [ENGINES*LENGTH_W-1:0] read_entry;
  wire [ENGINES*RECORD_W-1:0] read_data;
  bin #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .SIDE_BITS($clog2(SIDE)),
      .RECORDS(RECORDS),
      .RECORD_W(RECORD_W),
      .READERS(ENGINES),
      .TILE_W(TILE_W),
      .LENGTH_W(LENGTH_W)
  ) bin (
      .clk(clk),
      .rst(rst || drawing && !drain),
      .s_valid(splat_valid),
      .s_ready(splat_taken),
      .s_data({look, normal, amplitude, footprint}),
      .lengths(lengths),
      .r_tile(read_tile),
      .r_entry(read_entry),
      .r_data(read_data)
  );
  silence silence (.clk(clk), .rst(rst), .quiet(quiet), .silent(silent));

  // The queue.

  logic [TILE_W-1:0] next;
  logic [X_W-1:0] next_x;
  logic [Y_W-1:0] next_y;
  wire [ENGINES-1:0] wants, idle;
  wire [TILES-1:0] empty;
  for (genvar tile = 0; tile < TILES; tile++) begin : g_tile
    assign empty[tile] = lengths[tile*LENGTH_W+:LENGTH_W] == '0;
  end
  wire queued = drawing && next != TILE_W'(TILES);
  wire passed_over = queued && empty[next];
  wire [ENGINES-1:0] gets = queued && !passed_over ? wants & (~wants + ENGINES'(1)) : '0;
  wire last_of_row = next_x == X_W'(WIDTH - SIDE);
  always_ff @(posedge clk) begin
    drawing <= !rst && drain && (drawing || all_listed);
    if (!drawing) begin
      next <= '0;
      next_x <= '0;
      next_y <= '0;
    end else if (passed_over || gets != '0) begin
      next <= next + TILE_W'(1);
      next_x <= last_of_row ? '0 : next_x + X_W'(SIDE);
      if (last_of_row) next_y <= next_y + Y_W'(SIDE);
    end
  end
  wire all_blank;
  assign drained = drawing && !queued && &idle && all_blank;

  // Engines, and blank after them. An offered word stays until it is taken, whichever other unit
  // offers one.

  wire [ENGINES:0] offers;
  wire [(ENGINES+1)*OUT_W-1:0] words;
  logic [ENGINES:0] waiting;
  wire [ENGINES:0] chosen = waiting != '0 ? waiting : offers & (~offers + (ENGINES + 1)'(1));
  always_ff @(posedge clk) waiting <= rst || m_ready ? '0 : chosen;
  for (genvar nth = 0; nth < ENGINES; nth++) begin : g_engine
    engine #(
        .SIDE(SIDE),
        .LISTED(LISTED),
        .RECORD_W(RECORD_W),
        .TILE_W(TILE_W),
        .LENGTH_W(LENGTH_W),
        .ROMS(ROMS)
    ) engine (
        .clk(clk),
        .rst(rst),
        .frame(frame),
        .lights(lights),
        .materials(materials),
        .reflections(reflections),
        .t_ready(wants[nth]),
        .t_valid(gets[nth]),
        .t_tile(next),
        .t_corner({next_x, next_y}),
        .t_length(lengths[next*LENGTH_W+:LENGTH_W]),
        .r_tile(read_tile[nth*TILE_W+:TILE_W]),
        .r_entry(read_entry[nth*LENGTH_W+:LENGTH_W]),
        .r_data(read_data[nth*RECORD_W+:RECORD_W]),
        .idle(idle[nth]),
        .m_valid(offers[nth]),
        .m_ready(m_ready && chosen[nth]),
        .m_data(words[nth*OUT_W+:OUT_W])
    );
  end
  blank #(
      .COLUMNS(COLUMNS),
      .ROWS(ROWS),
      .SIDE(SIDE)
  ) blank (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .drawing(drawing),
      .empty(empty),
      .done(all_blank),
      .m_valid(offers[ENGINES]),
      .m_ready(m_ready && chosen[ENGINES]),
      .m_data(words[ENGINES*OUT_W+:OUT_W])
  );
  assign m_valid = offers != '0;
  assign m_data = picked(chosen, words);
endmodule

`default_nettype wire
