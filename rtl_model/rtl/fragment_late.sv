// Fragment_late: registers between a decision and its write, which synthesis may retime into sums
// and products.
//
//   decided ->[ register ]*(HAZARD - 2)-> write
`timescale 1ns / 1ps
`default_nettype none

module fragment_late #(
    parameter int W = 1,     // bits of what is written
    parameter int HAZARD = 1 // cycles before a pixel can be taken again
) (
    // With a hazard of at most 2 it is written at once.
    // verilator lint_off UNUSEDSIGNAL
    input wire clk,               // clock, rising edge
    input wire rst,               // no record is in flight
    // verilator lint_on UNUSEDSIGNAL
    input wire decided,           // a write is pending
    input wire [W-1:0] decision,  // namely this
    output wire write,            // it is written now
    output wire [W-1:0] written,  // namely this
    output wire under_way         // a write is pending
);
  if (HAZARD > 2) begin : g_late
    localparam int STAGES = HAZARD - 2;
    logic [STAGES-1:0] full;
    logic [STAGES*W-1:0] line;
    always_ff @(posedge clk) begin
      full <= rst ? '0 : STAGES'({full, decided});
      line <= (STAGES * W)'({line, decision});
    end
    assign write = full[STAGES-1];
    assign written = line[STAGES*W-1-:W];
    assign under_way = full != '0;
  end else begin : g_at_once
    assign write = decided;
    assign written = decision;
    assign under_way = 1'b0;
  end
endmodule

`default_nettype wire
