// Bench_start: the initial contents of pixels in a window, one record per cycle, before the first
// input. A machine cannot load its pixels, and an RTL implementation has no port for it: the parent
// writes the records directly into its memory.
//
// Arguments
//   +start=FILE      initial contents of the pixels, one line of hex per record; by default none
`timescale 1ns / 1ps
`default_nettype none

module bench_start #(
  parameter int WIDTH = 16 // columns of the picture
) (
  input wire clk,                                        // clock, rising edge
  input wire rst,                                        // stops the output
  output reg loaded,                                     // all records were output
  output reg loads,                                      // a record is valid
  output reg [machine_pkg::FRAGMENT_START_W-1:0] record, // fragment.start
  output wire [31:0] pixel                               // its pixel's index, row by row
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
      // The last record is written in the cycle in which the file ends.
      have = $fscanf(file, "%h", read) == 1;
      loads <= have;
      record <= read;
      loaded <= !have;
    end
  end
endmodule

`default_nettype wire
