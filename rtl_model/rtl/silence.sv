// Silence: whether no record is in flight: no record was offered anywhere for the latency of the
// slowest unit.
`timescale 1ns / 1ps
`default_nettype none

module silence (
    input wire clk,    // clock, rising edge
    input wire rst,    // records may be in flight
    input wire quiet,  // no record is offered
    output wire silent // no record is in flight
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
