// Windows_dimmed: a transmittance multiplied by that of a light. RTL implementation of a fit in
// units/fragment/window.rs.
//
// Loss: the result is rounded to the word of a transmittance.
`timescale 1ns / 1ps
`default_nettype none

module windows_dimmed (
    input wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] through, // the transmittance
    input wire [machine_pkg::SHADE_PREMULTIPLIED_W-1:0] clear,       // transmittance of the light
    output wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] next    // of both
);
  localparam int EXACT_W = machine_pkg::FRAGMENT_WINDOW_THROUGH_W + machine_pkg::SHADE_PREMULTIPLIED_W + 2;

  wire signed [EXACT_W-1:0] exact = $signed({1'b0, through}) * $signed({1'b0, clear});
  fit #(
      .IN_W(EXACT_W),
      .PLACES(machine_pkg::SHADE_PREMULTIPLIED_F),
      .W(machine_pkg::FRAGMENT_WINDOW_THROUGH_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_THROUGH_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_THROUGH_WRAP)
  ) fit_next (
      .exact(exact),
      .word(next)
  );
endmodule

`default_nettype wire
