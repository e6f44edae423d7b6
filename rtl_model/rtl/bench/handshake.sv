// Handshake: the rule of all ports: an offered record does not change until it is taken, and has no
// unknown bits.
//
// Concurrent assertions, for Verilator and other simulators that support them. For Icarus, bench.sv
// checks the same in statements.
`timescale 1ns / 1ps
`default_nettype none

module handshake #(
  parameter int W = 1 // bits of a record
) (
  input wire clk,         // clock, rising edge
  input wire rst,         // the rule does not apply
  input wire valid,       // a record is offered
  input wire ready,       // and is taken
  input wire [W-1:0] data // the record
);
  stays: assert property (@(posedge clk) disable iff (rst) valid && !ready |=> valid)
  else $error("handshake: an offer that was not taken is gone");

  is_stable: assert property (@(posedge clk) disable iff (rst) valid && !ready |=> $stable(data))
  else $error("handshake: an offer that was not taken has changed");

  is_known: assert property (@(posedge clk) disable iff (rst) !$isunknown({valid, ready}))
  else $error("handshake: valid or ready is unknown");

  has_known_bits: assert property (@(posedge clk) disable iff (rst) valid |-> !$isunknown(data))
  else $error("handshake: bits of what is offered are unknown");
endmodule

`default_nettype wire
