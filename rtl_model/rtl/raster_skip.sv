// Raster_skip: the value of a twice differenced register after a number of steps, in closed form.
// RTL implementation of `after` in units/raster.rs.
//
//   value + steps * first + steps * (steps - 1) / 2 * second
//
// Loss: none; everything wraps as the register does.
`timescale 1ns / 1ps
`default_nettype none

module raster_skip #(
    parameter int W = 1,      // bits of the register
    parameter int STEPS_W = 1 // bits of the steps
) (
    input wire [W-1:0] value,       // of the register
    input wire [W-1:0] first,       // its first difference there
    input wire [W-1:0] second,      // and its second
    input wire [STEPS_W-1:0] steps, // number of steps
    output wire [W-1:0] skipped     // its value there
);
  localparam int PAIRS_W = 2 * STEPS_W > W ? 2 * STEPS_W : W;
  wire [PAIRS_W-1:0] there_and_back = PAIRS_W'(steps) * (PAIRS_W'(steps) - PAIRS_W'(1));
  assign skipped = value + first * W'(steps) + second * W'(there_and_back >> 1);
endmodule

`default_nettype wire
