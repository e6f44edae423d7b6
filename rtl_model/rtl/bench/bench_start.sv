// Bench of what a window begins with: what pixels hold at its start, a record a cycle, before anything is let in. A machine has no such way
// into its pixels, and a twin no port for it: who has this writes the records straight into the twin's memory.
//
// Arguments
//   +start=FILE      what pixels hold at the start, a line of hex a record; left out, nothing
`timescale 1ns / 1ps
`default_nettype none

module bench_start #(
  parameter int WIDTH = 16 // columns of the picture
) (
  input wire clk,                                        // everything happens at its rising edge
  input wire rst,                                        // waits
  output reg loaded,                                     // all records have been told
  output reg loads,                                      // one is told
  output reg [machine_pkg::FRAGMENT_START_W-1:0] record, // fragment.start
  output wire [31:0] pixel                               // its pixel's place, row by row
);
  localparam int NAME_CHARS = 512;

  reg [8*NAME_CHARS-1:0] name;
  reg [machine_pkg::FRAGMENT_START_W-1:0] read;
  reg have;
  integer file = 0;

  wire [31:0] x = 32'(record[machine_pkg::FRAGMENT_START_X_LSB+:machine_pkg::FRAGMENT_START_X_W]);
  wire [31:0] y = 32'(record[machine_pkg::FRAGMENT_START_Y_LSB+:machine_pkg::FRAGMENT_START_Y_W]);
  assign pixel = y * WIDTH + x;

  initial begin
    loads = 1'b0;
    record = '0;
    if ($value$plusargs("start=%s", name) != 0) begin
      file = $fopen(name, "r");
      if (file == 0) begin
        $display("bench: FAILED cannot read %0s", name);
        $finish(0);
      end
    end
    loaded = file == 0;
  end

  always @(posedge clk) begin
    if (!rst && !loaded) begin
      // The last one is written in the cycle in which no other one comes.
      have = $fscanf(file, "%h", read) == 1;
      loads <= have;
      record <= read;
      loaded <= !have;
    end
  end
endmodule

`default_nettype wire
