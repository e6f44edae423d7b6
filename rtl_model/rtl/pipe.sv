// Pipe: the latency of a combinational unit: registers behind it that synthesis may retime,
// followed by a FIFO.
//
//   s ->[ register ]*(latency - 1)->[ FIFO ]-> m
//
// It takes a record if there is a free place, as in the timing model. The registers never stall, so
// all places of the model, for records in flight and for stalled ones, are in the FIFO. A returned
// place is free one cycle later.
//
// A record without a result does not enter the FIFO: its place is returned when it leaves the
// registers.
`timescale 1ns / 1ps
`default_nettype none

module pipe #(
    parameter int W = 1,        // bits of a record
    parameter int LATENCY = 1,  // cycles from a record's acceptance to its offer
    parameter int INTERVAL = 1, // cycles from one acceptance to the next, at least
    parameter int ROOM = 1      // maximum records between their acceptance here and by the next unit
) (
    input wire clk,             // clock, rising edge
    input wire rst,             // empties the pipe
    input wire s_valid,         // a record is there
    output wire s_ready,        // and can be taken
    input wire s_keeps,         // it has a result
    input wire [W-1:0] s_data,  // the record
    output wire m_valid,        // a record is offered
    input wire m_ready,         // and taken
    output wire [W-1:0] m_data  // the record
);
  localparam int COUNT_W = $clog2(ROOM + 1);
  localparam int PLACE_W = ROOM > 1 ? $clog2(ROOM) : 1;
  localparam int REST_W = $clog2(INTERVAL + 1);

  logic [COUNT_W-1:0] held;    // taken and not given
  logic [COUNT_W-1:0] waiting; // of those, in the FIFO
  logic [REST_W-1:0] rest;     // cycles until the next acceptance
  logic [PLACE_W-1:0] tail, head;

  assign s_ready = rest == '0 && held != COUNT_W'(ROOM);
  assign m_valid = waiting != '0;
  wire take = s_valid && s_ready;
  wire give = m_valid && m_ready;

  wire through, kept;
  wire [W-1:0] arrived;
  wire arrive = through && kept;
  wire vanish = through && !kept;
  if (LATENCY > 1) begin : g_delay
    localparam int STAGES = LATENCY - 1;
    localparam int LINE_W = STAGES * (W + 1);
    logic [STAGES-1:0] full;
    logic [LINE_W-1:0] line;
    always_ff @(posedge clk) begin
      full <= rst ? '0 : STAGES'({full, take});
      line <= LINE_W'({line, s_keeps, s_data});
    end
    assign through = full[STAGES-1];
    assign {kept, arrived} = line[LINE_W-1-:W+1];
  end else begin : g_none
    assign through = take;
    assign {kept, arrived} = {s_keeps, s_data};
  end

  logic [W-1:0] fifo[0:ROOM-1];
  always_ff @(posedge clk) if (arrive) fifo[tail] <= arrived;
  assign m_data = fifo[head];

  always_ff @(posedge clk) begin
    if (rst) begin
      held <= '0;
      waiting <= '0;
      rest <= '0;
      tail <= '0;
      head <= '0;
    end else begin
      held <= held + COUNT_W'(take) - COUNT_W'(give) - COUNT_W'(vanish);
      waiting <= waiting + COUNT_W'(arrive) - COUNT_W'(give);
      rest <= take ? REST_W'(INTERVAL - 1) : rest == '0 ? '0 : rest - REST_W'(1);
      if (arrive) tail <= tail == PLACE_W'(ROOM - 1) ? '0 : tail + PLACE_W'(1);
      if (give) head <= head == PLACE_W'(ROOM - 1) ? '0 : head + PLACE_W'(1);
    end
  end
endmodule

`default_nettype wire
