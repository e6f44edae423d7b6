// Fifo: keeps records in order. The writer must check that there is a place, the reader that there
// is a record.
`timescale 1ns / 1ps
`default_nettype none

module fifo #(
    parameter int W = 1,     // bits of a record
    parameter int PLACES = 1 // records that it holds
) (
    input wire clk,             // clock, rising edge
    input wire rst,             // empties it
    input wire push,            // a record goes in
    input wire [W-1:0] s_data,  // the record
    input wire pop,             // the oldest one goes out
    output wire [W-1:0] m_data, // the oldest one
    output wire empty,          // there is none
    output wire full            // there is no place left
);
  localparam int COUNT_W = $clog2(PLACES + 1);
  localparam int PLACE_W = PLACES > 1 ? $clog2(PLACES) : 1;

  logic [W-1:0] memory[0:PLACES-1];
  logic [COUNT_W-1:0] held;
  logic [PLACE_W-1:0] tail, head;

  assign m_data = memory[head];
  assign empty = held == '0;
  assign full = held == COUNT_W'(PLACES);
  always_ff @(posedge clk) begin
    if (push) memory[tail] <= s_data;
    if (rst) begin
      held <= '0;
      tail <= '0;
      head <= '0;
    end else begin
      held <= held + COUNT_W'(push) - COUNT_W'(pop);
      if (push) tail <= tail == PLACE_W'(PLACES - 1) ? '0 : tail + PLACE_W'(1);
      if (pop) head <= head == PLACE_W'(PLACES - 1) ? '0 : head + PLACE_W'(1);
    end
  end
endmodule

`default_nettype wire
