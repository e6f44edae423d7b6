// Silence: whether nothing is under way any more: nothing has been offered anywhere for as long as a record takes through the slowest unit.
`timescale 1ns / 1ps
`default_nettype none

module silence (
    input wire clk,    // everything happens at its rising edge
    input wire rst,    // something may be under way
    input wire quiet,  // nothing is offered
    output wire silent // nothing is under way
);
  localparam int SETUP =
      machine_pkg::PROJECT_LATENCY > machine_pkg::ELLIPSE_LATENCY ? machine_pkg::PROJECT_LATENCY : machine_pkg::ELLIPSE_LATENCY;
  localparam int LIT = SETUP > machine_pkg::SHADE_LATENCY ? SETUP : machine_pkg::SHADE_LATENCY;
  localparam int FILL = machine_pkg::RASTER_LATENCY > machine_pkg::GAUSS_LATENCY ? machine_pkg::RASTER_LATENCY : machine_pkg::GAUSS_LATENCY;
  localparam int SLOWEST = LIT > FILL ? LIT : FILL;
  localparam int COUNT_W = $clog2(SLOWEST + 1);

  logic [COUNT_W-1:0] cycles;
  assign silent = cycles == COUNT_W'(SLOWEST);
  always_ff @(posedge clk) begin
    if (rst || !quiet) cycles <= '0;
    else if (!silent) cycles <= cycles + COUNT_W'(1);
  end
endmodule

`default_nettype wire
