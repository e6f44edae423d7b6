// Resolve: blends a pixel's layers front to back over the background and writes the frame word. RTL
// implementation of units/resolve.rs.
//
//   layers in depth order, one per cycle ->(* transmittance)->(sum)->(+ background)-> frame
//   opacity ->(1 - opacity)->(*)-> transmittance
//
// Losses: the transmittance is rounded at each layer; the sum is exact and rounded once, into the frame.
`timescale 1ns / 1ps
`default_nettype none

module resolve (
    input wire clk,                                     // clock, rising edge
    input wire rst,                                     // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,        // constants: the background
    input wire s_valid,                                 // a layer is there
    output wire s_ready,                                // and can be taken
    input wire [machine_pkg::RESOLVE_IN_W-1:0] s_data,  // resolve.in
    output wire m_valid,                                // a pixel is offered
    input wire m_ready,                                 // and taken
    output wire [machine_pkg::RESOLVE_OUT_W-1:0] m_data // resolve.out
);
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam int THROUGH_W = machine_pkg::RESOLVE_TRANSMITTANCE_W;
  localparam int THROUGH_F = machine_pkg::RESOLVE_TRANSMITTANCE_F;
  localparam int FRAME_W = machine_pkg::RESOLVE_FRAME_W;
  localparam int FRAME_F = machine_pkg::RESOLVE_FRAME_F;
  // Layers and background with common fraction bits; all layers of a pixel, and the background, in
  // one sum.
  localparam int FINEST_F = LIGHT_F > FRAME_F ? LIGHT_F : FRAME_F;
  localparam int LAYER_LEFT = FINEST_F - LIGHT_F;
  localparam int BACKGROUND_LEFT = FINEST_F - FRAME_F;
  localparam int SUM_F = THROUGH_F + FINEST_F;
  localparam int LAYER_W = THROUGH_W + LIGHT_W + LAYER_LEFT;
  localparam int BACKGROUND_W = THROUGH_W + FRAME_W + BACKGROUND_LEFT;
  localparam int TERM_W = LAYER_W > BACKGROUND_W ? LAYER_W : BACKGROUND_W;
  localparam int SUM_W = TERM_W + $clog2(machine_pkg::FRAGMENT_LAYERS + 1);
  localparam [LIGHT_W-1:0] OPAQUE = LIGHT_W'(1) << LIGHT_F;
  localparam [SUM_W-1:0] ONE = SUM_W'(1) << SUM_F;

  wire last = s_data[machine_pkg::RESOLVE_IN_LAST_LSB];
  wire empty = s_data[machine_pkg::RESOLVE_IN_EMPTY_LSB];
  wire [LIGHT_W-1:0] opacity = s_data[machine_pkg::RESOLVE_IN_OPACITY_LSB+:LIGHT_W];

  // Transmittance and sum of the layers before.
  logic first;
  logic [THROUGH_W-1:0] kept;
  wire [THROUGH_W-1:0] transmittance = first ? THROUGH_W'(1) << THROUGH_F : kept;

  wire [LIGHT_W-1:0] clear = opacity > OPAQUE ? '0 : OPAQUE - opacity;
  wire [THROUGH_W+LIGHT_W-1:0] through = transmittance * clear;
  wire [THROUGH_W-1:0] behind_layer;
  fit #(.IN_W(THROUGH_W + LIGHT_W + 1), .PLACES(LIGHT_F), .W(THROUGH_W), .S(0), .ROUND(machine_pkg::RESOLVE_TRANSMITTANCE_ROUND),
      .WRAP(machine_pkg::RESOLVE_TRANSMITTANCE_WRAP)) thinner (.exact($signed({1'b0, through})), .word(behind_layer));
  wire [THROUGH_W-1:0] left = empty ? transmittance : behind_layer;

  wire room;
  wire takes = s_valid && s_ready;
  assign s_ready = room || (s_valid && !last);
  always_ff @(posedge clk) begin
    if (rst) first <= 1'b1;
    else if (takes) first <= last;
    if (takes) kept <= left;
  end

  // Red, green, blue: from the MSB down.
  wire [3*FRAME_W-1:0] rgb;
  for (genvar channel = 0; channel < 3; channel++) begin : g_channel
    wire [LIGHT_W-1:0] colour = s_data[machine_pkg::RESOLVE_IN_COLOUR_R_LSB-channel*LIGHT_W+:LIGHT_W];
    wire [FRAME_W-1:0] background = frame[machine_pkg::FRAME_BACKGROUND_R_LSB-channel*FRAME_W+:FRAME_W];
    wire [THROUGH_W+LIGHT_W-1:0] seen = transmittance * colour;
    logic [SUM_W-1:0] sum;
    wire [SUM_W-1:0] sum_here = (first ? '0 : sum) + (empty ? '0 : SUM_W'(seen) << LAYER_LEFT);
    always_ff @(posedge clk) if (takes) sum <= sum_here;

    wire [THROUGH_W+FRAME_W-1:0] seen_through = left * background;
    wire [SUM_W-1:0] over = sum_here + (SUM_W'(seen_through) << BACKGROUND_LEFT);
    wire [SUM_W-1:0] limited = over > ONE ? ONE : over;
    fit #(.IN_W(SUM_W + 1), .PLACES(SUM_F - FRAME_F), .W(FRAME_W), .S(0), .ROUND(machine_pkg::RESOLVE_FRAME_ROUND),
        .WRAP(machine_pkg::RESOLVE_FRAME_WRAP))
        painter (.exact($signed({1'b0, limited})), .word(rgb[(2-channel)*FRAME_W+:FRAME_W]));
  end

  // The background's opacity may be more than 1.
  wire [FRAME_W-1:0] background = frame[machine_pkg::FRAME_BACKGROUND_A_LSB+:FRAME_W];
  wire signed [FRAME_W:0] bare = $signed((FRAME_W + 1)'(1) << FRAME_F) - $signed({1'b0, background});
  wire signed [THROUGH_W+FRAME_W:0] see_through = $signed({1'b0, left}) * bare;
  wire signed [SUM_W:0] covered = $signed({1'b0, ONE}) - ((SUM_W + 1)'(see_through) <<< BACKGROUND_LEFT);
  wire [FRAME_W-1:0] alpha;
  fit #(.IN_W(SUM_W + 1), .PLACES(SUM_F - FRAME_F), .W(FRAME_W), .S(0), .ROUND(machine_pkg::RESOLVE_FRAME_ROUND),
      .WRAP(machine_pkg::RESOLVE_FRAME_WRAP)) coverer (.exact(covered), .word(alpha));

  localparam int X_W = machine_pkg::RESOLVE_IN_X_W;
  localparam int Y_W = machine_pkg::RESOLVE_IN_Y_W;
  wire [X_W-1:0] x = s_data[machine_pkg::RESOLVE_IN_X_LSB+:X_W];
  wire [Y_W-1:0] y = s_data[machine_pkg::RESOLVE_IN_Y_LSB+:Y_W];
  pipe #(.W(machine_pkg::RESOLVE_OUT_W), .LATENCY(machine_pkg::RESOLVE_LATENCY), .INTERVAL(machine_pkg::RESOLVE_INTERVAL),
      .ROOM(machine_pkg::RESOLVE_ROOM)) behind (.clk(clk), .rst(rst), .s_valid(s_valid && last), .s_ready(room), .s_keeps(1'b1),
      .s_data({x, y, rgb, alpha}), .m_valid(m_valid), .m_ready(m_ready), .m_data(m_data));

  wire unused = &{1'b0, frame};
endmodule

`default_nettype wire
