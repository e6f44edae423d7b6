// Ellipse_visibility: an area over the root of the determinant. RTL implementation of `visibility`
// in units/ellipse.rs.
//
//   |area| ->(* 1/sqrt det V')->[ fit ]-> visibility
//
// Loss: the result is rounded once.
`timescale 1ns / 1ps
`default_nettype none

module ellipse_visibility (
    input wire signed [machine_pkg::ELLIPSE_AREA_W-1:0] area,              // of either sign
    input wire [machine_pkg::ELLIPSE_ROOT_BITS:0] root,                    // 1/sqrt det V' is this
    input wire signed [7:0] root_exponent,                                 // times 2 to the power of this
    output wire [machine_pkg::ELLIPSE_VISIBILITY_W-1:0] visibility         // the amplitude of a kernel of height 1
);
  localparam int AREA_W = machine_pkg::ELLIPSE_AREA_W;
  localparam int AREA_F = machine_pkg::ELLIPSE_AREA_F;
  localparam int ROOT_BITS = machine_pkg::ELLIPSE_ROOT_BITS;
  localparam int VISIBILITY_W = machine_pkg::ELLIPSE_VISIBILITY_W;
  localparam int VISIBILITY_F = machine_pkg::ELLIPSE_VISIBILITY_F;

  localparam int SEEN_W = AREA_W + ROOT_BITS + 2;
  wire [AREA_W-1:0] area_magnitude = area[AREA_W-1] ? -area : area;
  wire signed [SEEN_W-1:0] seen = $signed({1'b0, area_magnitude}) * $signed({1'b0, root});
  wire signed [8:0] visibility_more = -(9'(root_exponent));
  fit_shifted #(.IN_W(SEEN_W), .PLACES(AREA_F + ROOT_BITS - VISIBILITY_F), .MORE_W(9), .W(VISIBILITY_W), .S(0),
      .ROUND(machine_pkg::ELLIPSE_VISIBILITY_ROUND), .WRAP(machine_pkg::ELLIPSE_VISIBILITY_WRAP))
      fit_visibility (.exact(seen), .more(visibility_more), .word(visibility));
endmodule

`default_nettype wire
