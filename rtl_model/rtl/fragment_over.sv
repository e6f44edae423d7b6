// Fragment_over: one channel of front over back, both premultiplied. RTL implementation of the
// blend in units/fragment.rs, merged.
//
//   front --------------------(+)->[ fit ]-> word
//   back ->(x)-----------------^
//   1 - opacity of the front ^
//
// Loss: the channel is rounded once, to a sum of the slot.
`timescale 1ns / 1ps
`default_nettype none

module fragment_over #(
    parameter int W = 1,     // bits of the slot's sum
    parameter int F = 0,     // its fraction bits
    parameter int S = 0,     // 1: it is signed
    parameter int ROUND = 1, // 0 truncate, 1 nearest (ties up), 2 nearest-even
    parameter int WRAP = 0   // 0 saturate, 1 wrap
) (
    input wire [machine_pkg::SHADE_PREMULTIPLIED_W-1:0] front,   // the channel of the front
    input wire [machine_pkg::SHADE_PREMULTIPLIED_W-1:0] back,    // the channel of the back
    input wire [machine_pkg::SHADE_PREMULTIPLIED_W-1:0] opacity, // of the front
    output wire [W-1:0] word                                     // the channel of both
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  // An opacity of more than 1 gives a negative transmittance.
  localparam int THROUGH_W = (LIGHT_W > LIGHT_F + 1 ? LIGHT_W : LIGHT_F + 1) + 1;
  localparam int EXACT_W = LIGHT_W + THROUGH_W + 1;

  wire signed [THROUGH_W-1:0] through = $signed(THROUGH_W'(1) << LIGHT_F) - $signed(THROUGH_W'(opacity));
  wire signed [EXACT_W-1:0] exact = (EXACT_W'($signed({1'b0, front})) <<< LIGHT_F) + EXACT_W'($signed({1'b0, back})) * EXACT_W'(through);
  fit #(.IN_W(EXACT_W), .PLACES(2 * LIGHT_F - F), .W(W), .S(S), .ROUND(ROUND), .WRAP(WRAP)) fit_blend (.exact(exact), .word(word));
endmodule

`default_nettype wire
