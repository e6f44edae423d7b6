// Windows_rest: 1 minus an opacity, as a transmittance. RTL implementation of `rest` in
// units/fragment/window.rs.
//
// Loss: the result is rounded to the word of a transmittance; results below 0 are 0.
`timescale 1ns / 1ps
`default_nettype none

module windows_rest (
    input wire [machine_pkg::SHADE_PREMULTIPLIED_W-1:0] opacity,      // of a light
    output wire [machine_pkg::FRAGMENT_WINDOW_THROUGH_W-1:0] through  // its transmittance
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int EXACT_W = (LIGHT_W > LIGHT_F + 1 ? LIGHT_W : LIGHT_F + 1) + 1;

  wire signed [EXACT_W-1:0] exact = $signed(EXACT_W'(1) << LIGHT_F) - $signed(EXACT_W'(opacity));
  fit #(
      .IN_W(EXACT_W),
      .PLACES(LIGHT_F - machine_pkg::FRAGMENT_WINDOW_THROUGH_F),
      .W(machine_pkg::FRAGMENT_WINDOW_THROUGH_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_THROUGH_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_THROUGH_WRAP)
  ) fit_rest (
      .exact(exact),
      .word(through)
  );
endmodule

`default_nettype wire
