// Windows_narrow: whether a slot can take anything by its width. Twin of the widths in units/fragment/window.rs: what a contribution
// adds to them is seen by its depth alone, once this is known.
//
//   far - near < reach      front_far - near < threshold      far - back_near < threshold
`timescale 1ns / 1ps
`default_nettype none

module windows_narrow (
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] near,      // of a slot: its nearest depth
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] far,       // and its farthest one
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] front_far, // of a closed one: the end of its front
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] back_near, // and the beginning of its back
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] reach,     // a slot is narrower than this
    input wire [machine_pkg::FRAGMENT_DEPTH_W-1:0] threshold, // a side is narrower than this
    output wire [2:0] narrow                                  // its back, its front, all of it
);
  assign narrow = {far - back_near < threshold, front_far - near < threshold, far - near < reach};
endmodule

`default_nettype wire
