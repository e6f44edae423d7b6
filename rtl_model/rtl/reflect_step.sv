// Reflect_step: the step of the map in which a coordinate is, and the fraction within it. RTL
// implementation of Map::step in functions/map.rs, and of the last line of Reflect::place in
// units/shade/reflect.rs.
//
//   coordinate, side ->( 1 + or - )-> place ->(* 2^k - 1)->[ index | fraction ]
//
// Loss: the fraction is rounded, and at most 1.
`timescale 1ns / 1ps
`default_nettype none

module reflect_step (
    input wire [machine_pkg::REFLECT_COORDINATE_W-1:0] coordinate, // magnitude, at most 1
    input wire less,                                               // it lies before the middle
    output wire [machine_pkg::REFLECT_INDEX_BITS-1:0] index,       // the texel before it
    output wire [machine_pkg::REFLECT_FRACTION_W-1:0] fraction     // fraction of the step to the next one
);
  localparam int COORDINATE_F = machine_pkg::REFLECT_COORDINATE_F;
  localparam int INDEX_BITS = machine_pkg::REFLECT_INDEX_BITS;
  localparam int FRACTION_W = machine_pkg::REFLECT_FRACTION_W;
  localparam int FRACTION_F = machine_pkg::REFLECT_FRACTION_F;
  localparam int PLACE_F = COORDINATE_F + 1;
  localparam int PLACE_W = PLACE_F + 1;
  localparam int EXACT_W = PLACE_W + INDEX_BITS;
  localparam [PLACE_W-1:0] ONE = PLACE_W'(1) << COORDINATE_F;
  localparam [EXACT_W-1:0] LAST = (EXACT_W'(1) << INDEX_BITS) - EXACT_W'(2);
  localparam [FRACTION_W-1:0] FRACTION_ONE = FRACTION_W'(1) << FRACTION_F;

  wire [PLACE_W-1:0] place = less ? ONE - PLACE_W'(coordinate) : ONE + PLACE_W'(coordinate);
  wire [EXACT_W-1:0] exact = (EXACT_W'(place) << INDEX_BITS) - EXACT_W'(place);
  wire [EXACT_W-1:0] whole = exact >> PLACE_F;
  wire [EXACT_W-1:0] first = whole > LAST ? LAST : whole;
  assign index = INDEX_BITS'(first);
  wire [PLACE_F:0] rest = (PLACE_F + 1)'(exact - (first << PLACE_F));
  wire signed [PLACE_F+1:0] far = {1'b0, rest};
  wire [FRACTION_W-1:0] word;
  fit #(.IN_W(PLACE_F + 2), .PLACES(PLACE_F - FRACTION_F), .W(FRACTION_W), .S(0), .ROUND(machine_pkg::REFLECT_FRACTION_ROUND),
      .WRAP(machine_pkg::REFLECT_FRACTION_WRAP)) rounder (.exact(far), .word(word));
  assign fraction = word > FRACTION_ONE ? FRACTION_ONE : word;
endmodule

`default_nettype wire
