// Delay: registers behind combinational logic, which synthesis may retime into it.
//
//   now ->[ register ]*STAGES-> late
`timescale 1ns / 1ps
`default_nettype none

module delay #(
    parameter int W = 1,     // bits of a word
    parameter int STAGES = 1 // number of registers; 0 is a wire
) (
    // A wire needs no clock.
    // verilator lint_off UNUSEDSIGNAL
    input wire clk,          // clock, rising edge
    // verilator lint_on UNUSEDSIGNAL
    input wire [W-1:0] now,  // a word
    output wire [W-1:0] late // the word STAGES cycles earlier
);
  if (STAGES > 0) begin : g_delay
    logic [STAGES*W-1:0] line;
    always_ff @(posedge clk) line <= (STAGES * W)'({line, now});
    assign late = line[STAGES*W-1-:W];
  end else begin : g_none
    assign late = now;
  end
endmodule

`default_nettype wire
