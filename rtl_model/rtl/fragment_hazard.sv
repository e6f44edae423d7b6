// Fragment_hazard: pixels that were taken and cannot be taken again yet.
//
//   pixel ->[ taken in the last HAZARD - 1 cycles? ]-> stalls
//
// A pixel that is still being processed counts as taken in its last cycle.
`timescale 1ns / 1ps
`default_nettype none

module fragment_hazard #(
    parameter int PIXEL_W = 1, // bits of a pixel's number
    parameter int HAZARD = 1   // cycles before a pixel can be taken again
) (
    input wire clk,                        // clock, rising edge
    input wire rst,                        // no pixel has been taken
    input wire take,                       // the next one is taken
    input wire [PIXEL_W-1:0] next,         // which one it is, or would be
    // With a hazard of 1 there are no stalls.
    // verilator lint_off UNUSEDSIGNAL
    input wire stays,                      // the one before keeps the unit
    input wire [PIXEL_W-1:0] pixel,        // its index
    // verilator lint_on UNUSEDSIGNAL
    output wire waits                      // the next one cannot be taken
);
  if (HAZARD > 1) begin : g_hazard
    localparam int AGES = HAZARD - 1;
    logic [AGES-1:0] aged;
    logic [AGES*PIXEL_W-1:0] aged_pixels;
    always_ff @(posedge clk) begin
      aged <= rst ? '0 : AGES'({aged, take || stays});
      aged_pixels <= (AGES * PIXEL_W)'({aged_pixels, stays ? pixel : next});
    end
    wire [AGES-1:0] same;
    for (genvar age = 0; age < AGES; age++) begin : g_age
      assign same[age] = aged[age] && aged_pixels[age*PIXEL_W+:PIXEL_W] == next;
    end
    assign waits = same != '0;
  end else begin : g_no_hazard
    assign waits = 1'b0;
    wire unused = &{clk, rst, take, next};
  end
endmodule

`default_nettype wire
