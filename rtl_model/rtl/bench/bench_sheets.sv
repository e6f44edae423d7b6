// Bench_sheets: sheets with its final contents written to a file, as a unit with one input and one
// output for bench.sv.
//
//   s ->( sheets )-> m      h -> +held=FILE
//
// Compile with bench.sv, bench_start.sv, -DDUT=bench_sheets -DHAS_FRAME -DHAS_DRAIN -DIN_W=machine_pkg::FRAGMENT_IN_W
// -DOUT_W=machine_pkg::FRAGMENT_OUT_W and '-DDUT_PARAMETERS=.WIDTH(64),.HEIGHT(64)'.
// Arguments, in addition to those of bench.sv and bench_start.sv
//   +held=FILE       file for the final contents of the pixels
//   +stall_held=N    percent of cycles in which no final content is taken
`timescale 1ns / 1ps
`default_nettype none

// A program, not hardware: a counter is read in the cycle in which it changes.
// verilator lint_off BLKSEQ
module bench_sheets #(
  parameter int WIDTH = 16,  // columns of pixels
  parameter int HEIGHT = 16, // rows of pixels
  parameter ROMS = "rom/"    // folder of the tables, with its slash
) (
  input wire clk,                                       // as sheets'
  input wire rst,                                       // as sheets'
  input wire [machine_pkg::FRAME_W-1:0] frame,          // as sheets'
  input wire s_valid,                                   // as sheets'
  output wire s_ready,                                  // as sheets'
  input wire [machine_pkg::FRAGMENT_IN_W-1:0] s_data,   // as sheets'
  output wire m_valid,                                  // as sheets'
  input wire m_ready,                                   // as sheets'
  output wire [machine_pkg::FRAGMENT_OUT_W-1:0] m_data, // as sheets'
  input wire drain,                                     // as sheets'
  output wire drained                                   // as sheets'
);
  localparam int NAME_CHARS = 512;
  localparam int HELD_W = machine_pkg::FRAGMENT_HELD_W;

  wire loaded, loads;
  wire [machine_pkg::FRAGMENT_START_W-1:0] start;
  wire [31:0] start_pixel;
  bench_start #(.WIDTH(WIDTH)) starter (
    .clk(clk),
    .rst(rst),
    .loaded(loaded),
    .loads(loads),
    .record(start),
    .pixel(start_pixel)
  );

  wire takes;
  assign s_ready = takes && loaded;
  wire h_valid;
  wire h_empty;
  reg h_ready = 1'b0;
  wire [HELD_W-1:0] h_data;

  sheets #(
    .WIDTH(WIDTH),
    .HEIGHT(HEIGHT),
    .ROMS(ROMS)
  ) sheets (
    .clk(clk),
    .rst(rst),
    .frame(frame),
    .s_valid(s_valid && loaded),
    .s_ready(takes),
    .s_data(s_data),
    .m_valid(m_valid),
    .m_ready(m_ready),
    .m_data(m_data),
    .drain(drain && loaded),
    .drained(drained),
    .h_valid(h_valid),
    .h_ready(h_ready),
    .h_empty(h_empty),
    .h_data(h_data)
  );

`ifndef NETLIST
  // The initial contents of pixels are written directly into their memory, which has another name
  // in a netlist.
  always @(posedge clk) begin
    if (loads) begin
      sheets.memory[start_pixel] <= start[machine_pkg::FRAGMENT_START_Y_LSB-1:0];
      sheets.touched[start_pixel] <= 1'b1;
    end
  end
`endif

  reg [8*NAME_CHARS-1:0] name;
  integer held_file = 0;
  integer stall_held;
  reg [31:0] chance = 32'h2545f491;
  longint cycle = 0;
  longint violations = 0;
  reg h_waits = 1'b0;
  reg [HELD_W-1:0] h_waiting = '0;

  function automatic [31:0] xorshift(input [31:0] state);
    reg [31:0] x;
    begin
      x = state ^ (state << 13);
      x = x ^ (x >> 17);
      xorshift = x ^ (x << 5);
    end
  endfunction

  initial begin
    if ($value$plusargs("stall_held=%d", stall_held) == 0) stall_held = 0;
    if ($value$plusargs("held=%s", name) != 0) held_file = $fopen(name, "w");
  end

  always @(posedge clk) begin
    chance = xorshift(chance);
    if (!rst) begin
      // Offered records stay until they are taken.
      if (h_waits && (!h_valid || !h_empty && h_data !== h_waiting)) begin
        violations = violations + 1;
        if (violations == 1) $display("bench: FAILED in cycle %0d what was offered and not taken, at h, has changed", cycle);
      end
      h_waits = h_valid && !h_ready;
      h_waiting = h_data;
      // There are no unknown bits.
      if ((h_valid ^ h_valid) !== 1'b0 || h_valid && !h_empty && (^h_data ^ ^h_data) !== 1'b0) begin
        violations = violations + 1;
        if (violations == 1) $display("bench: FAILED in cycle %0d what is offered at h is not known: %h", cycle, h_data);
      end
      if (h_valid && h_ready && !h_empty && held_file != 0) $fwrite(held_file, "%h\n", h_data);
      cycle = cycle + 1;
    end
    h_ready <= (chance >> 6) % 100 >= stall_held;
  end
endmodule
// verilator lint_on BLKSEQ

`default_nettype wire
