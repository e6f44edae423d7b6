// Bench_sheets: sheets with what it holds in the end written down, as a unit with one input and one output that bench.sv can drive.
//
//   s ->( sheets )-> m      h -> +held=FILE
//
// Compile with bench.sv, -DDUT=bench_sheets -DHAS_FRAME -DHAS_DRAIN -DIN_W=machine_pkg::FRAGMENT_IN_W -DOUT_W=machine_pkg::FRAGMENT_OUT_W
// and '-DDUT_PARAMETERS=.WIDTH(64),.HEIGHT(64)'.
// Arguments, besides those of bench.sv
//   +start=FILE      what pixels hold at the start; left out, nothing
//   +held=FILE       where to write what the pixels hold in the end
//   +stall_held=N    percent of cycles in which nothing that is held is taken
`default_nettype none

// A program, not hardware: what a cycle counts, the same cycle reads.
// verilator lint_off BLKSEQ
module bench_sheets #(
  parameter int WIDTH = 16, // columns of pixels
  parameter int HEIGHT = 16 // rows of pixels
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

  wire takes;
  assign s_ready = takes && loaded;
  wire h_valid;
  wire h_empty;
  reg h_ready = 1'b0;
  wire [HELD_W-1:0] h_data;

  sheets #(
    .WIDTH(WIDTH),
    .HEIGHT(HEIGHT)
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

  // What pixels hold at the start goes straight into their memory, a record a cycle, before anything is let in: a machine has no such way,
  // and a twin no port for it.
  localparam int START_W = machine_pkg::FRAGMENT_START_W;
  reg loads = 1'b0;
  reg loaded = 1'b0;
  reg [START_W-1:0] start = '0;
  reg [START_W-1:0] read_start;
  wire [31:0] start_x = 32'(start[machine_pkg::FRAGMENT_START_X_LSB+:machine_pkg::FRAGMENT_START_X_W]);
  wire [31:0] start_y = 32'(start[machine_pkg::FRAGMENT_START_Y_LSB+:machine_pkg::FRAGMENT_START_Y_W]);
  wire [31:0] start_pixel = start_y * WIDTH + start_x;
  always @(posedge clk) begin
    if (loads) begin
      sheets.memory[start_pixel] <= start[machine_pkg::FRAGMENT_START_Y_LSB-1:0];
      sheets.touched[start_pixel] <= 1'b1;
    end
  end

  reg [8*NAME_CHARS-1:0] name;
  integer start_file = 0;
  reg have_start;
  integer held_file = 0;
  integer stall_held;
  reg [31:0] chance = 32'h2545f491;
  longint cycle = 0;
  longint violations = 0;
  reg h_waits = 1'b0;
  reg [HELD_W-1:0] h_waiting = '0;

  function [31:0] xorshift(input [31:0] state);
    reg [31:0] x;
    begin
      x = state ^ (state << 13);
      x = x ^ (x >> 17);
      xorshift = x ^ (x << 5);
    end
  endfunction

  initial begin
    if ($value$plusargs("start=%s", name) != 0) begin
      start_file = $fopen(name, "r");
      if (start_file == 0) begin
        $display("bench: FAILED cannot read %0s", name);
        $finish(0);
      end
    end
    loaded = start_file == 0;
    if ($value$plusargs("stall_held=%d", stall_held) == 0) stall_held = 0;
    if ($value$plusargs("held=%s", name) != 0) held_file = $fopen(name, "w");
  end

  always @(posedge clk) begin
    chance = xorshift(chance);
    if (!rst) begin
      if (!loaded) begin
        // The last one is written in the cycle in which no other one comes.
        have_start = $fscanf(start_file, "%h", read_start) == 1;
        loads <= have_start;
        start <= read_start;
        loaded <= !have_start;
      end
      // What waits stays.
      if (h_waits && (!h_valid || !h_empty && h_data !== h_waiting)) begin
        violations = violations + 1;
        if (violations == 1) $display("bench: FAILED in cycle %0d what was offered and not taken, at h, has changed", cycle);
      end
      h_waits = h_valid && !h_ready;
      h_waiting = h_data;
      if (h_valid && h_ready && !h_empty && held_file != 0) $fwrite(held_file, "%h\n", h_data);
      cycle = cycle + 1;
    end
    h_ready <= (chance >> 6) % 100 >= stall_held;
  end
endmodule
// verilator lint_on BLKSEQ

`default_nettype wire
