// Sheets: adds fragments of the same sheet, and blends a sheet when the next one begins. RTL
// implementation of units/fragment/sheets.rs.
//
//   s ->[ read the pixel ]->[ sheet = open? ]-+- yes -> accumulate: sums += weight * attributes
//                                             +- no --> close the open one (sheets_close) ->[ over ]-> composite; open a fresh one
//
//   m <- outcome of each contribution        h <- after the last one: contents of all pixels
//
// If each splat is a separate sheet, nothing is added: its weight, clamped to a limit, is blended
// at once. With MACHINE_COMPOSITE every splat is, and a composite has a word of its own. A pixel
// whose transmittance is below `stop` takes no more contributions.
//
// A contribution is taken in one cycle. In the next cycle its pixel is read and the outcome is
// decided, and HAZARD - 2 registers later the pixel is written: the same pixel can be taken again
// after HAZARD cycles, any other one in the next cycle. While a sheet is blended because another
// begins, no contribution is taken for MERGE_CYCLES more cycles, as in the timing model, also if
// the pixel stops by this blend. s_ready therefore depends on a comparison of the sheets' numbers,
// but not on a sum, table or blend: these are only in the loop of the pixel, which has HAZARD
// registers.
//
// Losses: each sum is rounded once per contribution (fragment_sum), and so is the result of a blend
// (fragment_over). The light of a sheet and of the composite are truncated to the word of a light.
`timescale 1ns / 1ps
`default_nettype none

module sheets #(
    parameter int WIDTH = 16,  // columns of stored pixels
    parameter int HEIGHT = 16, // rows of stored pixels
    parameter ROMS = "rom/"    // folder of the tables, with its slash
) (
    input wire clk,                                            // clock, rising edge
    input wire rst,                                            // empties all pixels
    // The frame's constants are those of all units: this one uses those of sheets.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,               // constant while a frame is drawn
    // verilator lint_on UNUSEDSIGNAL
    input wire s_valid,                                        // a contribution is there
    output wire s_ready,                                       // and is taken
    input wire [machine_pkg::FRAGMENT_IN_W-1:0] s_data,        // the contribution
    output wire m_valid,                                       // a decision is there
    input wire m_ready,                                        // and is taken
    output wire [machine_pkg::FRAGMENT_OUT_W-1:0] m_data,      // the decision
    input wire drain,                                          // the last contribution was taken: output all pixels
    output wire drained,                                       // everything was output and all pixels are empty, until drain falls
    output wire h_valid,                                       // content of a pixel, or an empty pixel
    input wire h_ready,                                        // and is taken
    output wire h_empty,                                       // an empty pixel: only x and y have a meaning
    output wire [machine_pkg::FRAGMENT_HELD_W-1:0] h_data      // content
);
  localparam int PIXELS = WIDTH * HEIGHT;
  localparam int PIXEL_W = PIXELS > 1 ? $clog2(PIXELS) : 1;
  localparam int X_W = machine_pkg::FRAGMENT_IN_X_W;
  localparam int Y_W = machine_pkg::FRAGMENT_IN_Y_W;
  localparam int SLOT_NUMBER_W = machine_pkg::FRAGMENT_OUT_SLOT_W;
  localparam int HAZARD = machine_pkg::FRAGMENT_HAZARD;
  localparam int MERGE_CYCLES = machine_pkg::FRAGMENT_MERGE_CYCLES;

  localparam int GAUSS_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int SHEET_W = machine_pkg::FRAGMENT_IN_SHEET_W;
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;

  // The words of a composite: colour and opacity.
`ifdef MACHINE_COMPOSITE
  localparam int HELD_W = machine_pkg::FRAGMENT_COMPOSITE_W;
  localparam int HELD_F = machine_pkg::FRAGMENT_COMPOSITE_F;
  localparam int HELD_S = machine_pkg::FRAGMENT_COMPOSITE_S;
  localparam int HELD_ROUND = machine_pkg::FRAGMENT_COMPOSITE_ROUND;
  localparam int HELD_WRAP = machine_pkg::FRAGMENT_COMPOSITE_WRAP;
  localparam int THICK_W = HELD_W;
  localparam int THICK_F = HELD_F;
  localparam int THICK_S = HELD_S;
  localparam int THICK_ROUND = HELD_ROUND;
  localparam int THICK_WRAP = HELD_WRAP;
`else
  localparam int HELD_W = COLOUR_W;
  localparam int HELD_F = machine_pkg::FRAGMENT_COLOUR_SUM_F;
  localparam int HELD_S = machine_pkg::FRAGMENT_COLOUR_SUM_S;
  localparam int HELD_ROUND = machine_pkg::FRAGMENT_COLOUR_SUM_ROUND;
  localparam int HELD_WRAP = machine_pkg::FRAGMENT_COLOUR_SUM_WRAP;
  localparam int THICK_W = OPACITY_W;
  localparam int THICK_F = machine_pkg::FRAGMENT_OPACITY_SUM_F;
  localparam int THICK_S = machine_pkg::FRAGMENT_OPACITY_SUM_S;
  localparam int THICK_ROUND = machine_pkg::FRAGMENT_OPACITY_SUM_ROUND;
  localparam int THICK_WRAP = machine_pkg::FRAGMENT_OPACITY_SUM_WRAP;
`endif

  // A pixel as in its record, without x and y: stopped, closed, composite, and the open sheet. Blue
  // is the last colour.
  localparam int STATE_W = machine_pkg::FRAGMENT_START_W - X_W - Y_W;
  localparam int STOPPED = machine_pkg::FRAGMENT_START_STOPPED_LSB;
  localparam int CLOSED = machine_pkg::FRAGMENT_START_CLOSED_LSB;
  localparam int COLOURS = machine_pkg::FRAGMENT_START_COLOUR_B_LSB;
  localparam int OPACITY = machine_pkg::FRAGMENT_START_OPACITY_LSB;
  localparam int SHEET = machine_pkg::FRAGMENT_START_SHEET_LSB;
  localparam int WEIGHT = machine_pkg::FRAGMENT_START_WEIGHT_LSB;
  localparam int SHEET_COLOURS = machine_pkg::FRAGMENT_START_SHEET_B_LSB;

  localparam [machine_pkg::FRAGMENT_OUT_OUTCOME_W-1:0] ACCUMULATED = machine_pkg::OUTCOME_ACCUMULATED,
      INSERTED = machine_pkg::OUTCOME_INSERTED, MERGED = machine_pkg::OUTCOME_MERGED, DROPPED = machine_pkg::OUTCOME_DROPPED;

  wire each_splat = frame[machine_pkg::FRAME_EACH_SPLAT_LSB];
  wire back_to_front = frame[machine_pkg::FRAME_BACK_TO_FRONT_LSB];
  wire [OPACITY_W-1:0] stop = frame[machine_pkg::FRAME_STOP_LSB+:OPACITY_W];
  wire keeps_last = frame[machine_pkg::FRAME_KEEPS_LAST_LSB];
  wire [GAUSS_W-1:0] most_weight = frame[machine_pkg::FRAME_MOST_WEIGHT_LSB+:GAUSS_W];
  wire has_ratio = frame[machine_pkg::FRAME_HAS_RATIO_LSB];

  // Read: the pixel of a contribution, or, at the end, all pixels in order.

  wire take = s_valid && s_ready;
  wire [X_W-1:0] s_x = s_data[machine_pkg::FRAGMENT_IN_X_LSB+:X_W];
  wire [Y_W-1:0] s_y = s_data[machine_pkg::FRAGMENT_IN_Y_LSB+:Y_W];
  wire walk_on;
  logic walking;
  logic [X_W-1:0] next_x;
  logic [Y_W-1:0] next_y;
  wire read = take || walk_on;
  wire [X_W-1:0] read_x = walking ? next_x : s_x;
  wire [Y_W-1:0] read_y = walking ? next_y : s_y;
  wire [PIXEL_W-1:0] read_pixel = PIXEL_W'((X_W + Y_W)'(read_y) * (X_W + Y_W)'(WIDTH) + (X_W + Y_W)'(read_x));

  wire write;
  wire [PIXEL_W-1:0] write_pixel;
  wire [STATE_W-1:0] write_state;

  // A memory cannot be cleared at once, so touched pixels are marked in registers.
  logic [STATE_W-1:0] memory[0:PIXELS-1];
  logic [STATE_W-1:0] out;
  logic [PIXELS-1:0] touched;
  logic touched_out;
  wire empty_all;
  // Not an always_ff: the bench writes the pixels' initial contents at the start of a window, and a
  // variable that an always_ff drives may not be written elsewhere.
  always @(posedge clk) begin
    if (write) memory[write_pixel] <= write_state;
    if (read) out <= memory[read_pixel];
    if (read) touched_out <= touched[read_pixel];
    if (rst || empty_all) touched <= '0;
    else if (write) touched[write_pixel] <= 1'b1;
  end

  // With a hazard of 1 a pixel is read in the cycle in which it is written.
  wire [STATE_W-1:0] held;
  wire live;
  if (HAZARD == 1) begin : g_forward
    logic [STATE_W-1:0] late_state;
    logic late;
    always_ff @(posedge clk) begin
      if (read) begin
        late <= write && write_pixel == read_pixel;
        late_state <= write_state;
      end
    end
    assign live = late || touched_out;
    assign held = late ? late_state : touched_out ? out : '0;
  end else begin : g_stall
    assign live = touched_out;
    assign held = touched_out ? out : '0;
  end

  // Contribute: the contribution, and the current contents of its pixel.

  logic taken;
  logic [machine_pkg::FRAGMENT_IN_W-1:0] contribution;
  logic [PIXEL_W-1:0] pixel;
  wire leave;
  always_ff @(posedge clk) begin
    taken <= !rst && (take || taken && !leave);
    if (take) contribution <= s_data;
    if (take) pixel <= read_pixel;
  end

  wire [X_W-1:0] x = contribution[machine_pkg::FRAGMENT_IN_X_LSB+:X_W];
  wire [Y_W-1:0] y = contribution[machine_pkg::FRAGMENT_IN_Y_LSB+:Y_W];
  wire [GAUSS_W-1:0] some_weight = contribution[machine_pkg::FRAGMENT_IN_WEIGHT_LSB+:GAUSS_W];
  wire [SHEET_W-1:0] sheet = contribution[machine_pkg::FRAGMENT_IN_SHEET_LSB+:SHEET_W];
  wire [3*RGB_W-1:0] colour = contribution[machine_pkg::FRAGMENT_IN_BLUE_LSB+:3*RGB_W];

  wire stopped = held[STOPPED];
  wire matched = !stopped && !each_splat && live && held[SHEET+:SHEET_W] == sheet;
  wire [GAUSS_W-1:0] weight = each_splat && some_weight > most_weight ? most_weight : some_weight;

  // Accumulate: the sums of the open sheet, or of a new one.
  wire [WEIGHT_W-1:0] weight_was = matched ? held[WEIGHT+:WEIGHT_W] : '0;
  wire [3*COLOUR_W-1:0] colours_were = matched ? held[SHEET_COLOURS+:3*COLOUR_W] : '0;
  wire [WEIGHT_W-1:0] weight_becomes;
  wire [3*COLOUR_W-1:0] colours_become;
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(machine_pkg::FRAGMENT_WEIGHT_SUM_F),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WEIGHT_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) weight_sum (
      .sum(weight_was),
      .weight(weight),
      .attribute(1'b1),
      .next(weight_becomes)
  );
  for (genvar channel = 0; channel < 3; channel++) begin : g_accumulate
    fragment_sum #(
        .ATTRIBUTE_W(RGB_W),
        .ATTRIBUTE_F(machine_pkg::SPLAT_RGB_F),
        .ATTRIBUTE_S(machine_pkg::SPLAT_RGB_S),
        .W(COLOUR_W),
        .F(machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) colour_sum (
        .sum(colours_were[channel*COLOUR_W+:COLOUR_W]),
        .weight(weight),
        .attribute(colour[channel*RGB_W+:RGB_W]),
        .next(colours_become[channel*COLOUR_W+:COLOUR_W])
    );
  end

  // Blend a finished sheet: the contribution itself, or the open sheet; at the end, the open sheet
  // only for its light.
  wire [4*LIGHT_W-1:0] light, composite;
  sheets_close #(.ROMS(ROMS)) close (
      .has_ratio(has_ratio),
      .weight(each_splat ? weight_becomes : held[WEIGHT+:WEIGHT_W]),
      .colours(each_splat ? colours_become : held[SHEET_COLOURS+:3*COLOUR_W]),
      .light(light)
  );
  fragment_read #(.COLOUR_W(HELD_W), .COLOUR_F(HELD_F), .OPACITY_W(THICK_W), .OPACITY_F(THICK_F)) read_composite (
      .colours(held[COLOURS+:3*HELD_W]), .opacity(held[OPACITY+:THICK_W]), .lit(composite));
  wire [4*LIGHT_W-1:0] over = back_to_front ? light : composite;
  wire [4*LIGHT_W-1:0] under = back_to_front ? composite : light;
  wire [3*HELD_W-1:0] blended_colours;
  wire [THICK_W-1:0] blended_opacity;
  for (genvar channel = 0; channel < 3; channel++) begin : g_blend
    fragment_over #(
        .W(HELD_W),
        .F(HELD_F),
        .S(HELD_S),
        .ROUND(HELD_ROUND),
        .WRAP(HELD_WRAP)
    ) blend_colour (
        .front(over[(channel+1)*LIGHT_W+:LIGHT_W]),
        .back(under[(channel+1)*LIGHT_W+:LIGHT_W]),
        .opacity(over[LIGHT_W-1:0]),
        .word(blended_colours[channel*HELD_W+:HELD_W])
    );
  end
  fragment_over #(
      .W(THICK_W),
      .F(THICK_F),
      .S(THICK_S),
      .ROUND(THICK_ROUND),
      .WRAP(THICK_WRAP)
  ) blend_opacity (
      .front(over[LIGHT_W-1:0]),
      .back(under[LIGHT_W-1:0]),
      .opacity(over[LIGHT_W-1:0]),
      .word(blended_opacity)
  );
  // An opacity of more than 1 gives a negative transmittance.
  localparam int THROUGH_W = (OPACITY_W > THICK_W ? OPACITY_W : THICK_W) + 2;
  localparam [THROUGH_W-1:0] ONE = THROUGH_W'(1) << THICK_F;
  wire signed [THROUGH_W-1:0] through = $signed(ONE) - $signed(THROUGH_W'(blended_opacity));
  wire opaque = !back_to_front && through < $signed(THROUGH_W'(stop));
  wire kept = !opaque || keeps_last;

  // The outcome of the contribution.
  localparam int OUTCOME_W = machine_pkg::FRAGMENT_OUT_OUTCOME_W;
  wire blends = !stopped && !matched && (each_splat || live);
  wire refused = blends && (each_splat ? !kept : opaque);
  wire [OUTCOME_W-1:0] outcome = stopped || refused ? DROPPED : matched ? ACCUMULATED : live ? MERGED : INSERTED;
  wire [SLOT_NUMBER_W-1:0] decided_slot =
      outcome == ACCUMULATED || outcome == INSERTED && !each_splat ? SLOT_NUMBER_W'(1) : SLOT_NUMBER_W'(0);
  wire stops = stopped || blends && opaque;
  wire [STATE_W-1:0] decided;
  assign decided[STOPPED] = stops;
  assign decided[CLOSED] = each_splat || stops;
  assign decided[COLOURS+:3*HELD_W] = blends && kept ? blended_colours : held[COLOURS+:3*HELD_W];
  assign decided[OPACITY+:THICK_W] = blends && kept ? blended_opacity : held[OPACITY+:THICK_W];
  assign decided[SHEET+:SHEET_W] = sheet;
  assign decided[WEIGHT+:WEIGHT_W] = weight_becomes;
  assign decided[SHEET_COLOURS+:3*COLOUR_W] = colours_become;

  wire under_way;
  fragment_late #(
      .W(PIXEL_W + STATE_W),
      .HAZARD(HAZARD)
  ) late (
      .clk(clk),
      .rst(rst),
      .decided(leave),
      .decision({pixel, decided}),
      .write(write),
      .written({write_pixel, write_state}),
      .under_way(under_way)
  );

  // A sheet that is blended because another begins occupies the unit until its last cycle; any
  // other contribution has left when the next one comes.
  wire merging = taken && blends && !each_splat;
  wire free = leave && (!merging || MERGE_CYCLES == 0);
  wire waits;
  wire rests;
  fragment_hazard #(
      .PIXEL_W(PIXEL_W),
      .HAZARD(HAZARD)
  ) hazard (
      .clk(clk),
      .rst(rst),
      .take(take),
      .next(read_pixel),
      .stays(taken && !free || rests),
      .pixel(pixel),
      .waits(waits)
  );
  if (MERGE_CYCLES > 1) begin : g_rest
    localparam int REST_W = $clog2(MERGE_CYCLES);
    logic [REST_W-1:0] rest;
    always_ff @(posedge clk) begin
      if (rst) rest <= '0;
      else if (leave && merging) rest <= REST_W'(MERGE_CYCLES - 1);
      else if (rests) rest <= rest - REST_W'(1);
    end
    assign rests = rest != '0;
  end else begin : g_no_rest
    assign rests = 1'b0;
  end

  // Output of the decision: the remaining latency of the unit.
  localparam int REST_OF_LATENCY = machine_pkg::FRAGMENT_LATENCY > 1 ? machine_pkg::FRAGMENT_LATENCY - 1 : 1;
  localparam int REST_OF_ROOM = machine_pkg::FRAGMENT_LATENCY > 1 ? machine_pkg::FRAGMENT_ROOM - 1 : machine_pkg::FRAGMENT_ROOM;
  wire room;
  pipe #(
      .W(machine_pkg::FRAGMENT_OUT_W),
      .LATENCY(REST_OF_LATENCY),
      .INTERVAL(1),
      .ROOM(REST_OF_ROOM)
  ) decisions (
      .clk(clk),
      .rst(rst),
      .s_valid(taken),
      .s_ready(room),
      .s_keeps(1'b1),
      .s_data({x, y, outcome, decided_slot}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  assign leave = taken && room;
  logic done;
  assign s_ready = !walking && !done && !rests && !(s_valid && waits) && (!taken || free);

  // Walk: the contents of all pixels, row by row.

  wire start = drain && !s_valid && !taken && !under_way && !walking && !done;
  logic [X_W-1:0] at_x;
  logic [Y_W-1:0] at_y;
  logic here;
  assign h_valid = walking && here;
  assign h_empty = !live;
  wire next = walking && (!here || h_ready);
  wire over_all = next_y == Y_W'(HEIGHT);
  assign walk_on = next && !over_all;
  assign empty_all = next && over_all;
  assign drained = done;
  always_ff @(posedge clk) begin
    if (rst) begin
      walking <= 1'b0;
      done <= 1'b0;
    end else begin
      walking <= start || walking && !empty_all;
      done <= drain && (done || empty_all);
    end
    if (start) begin
      next_x <= '0;
      next_y <= '0;
      here <= 1'b0;
    end
    if (walk_on) begin
      at_x <= next_x;
      at_y <= next_y;
      here <= 1'b1;
      next_x <= next_x == X_W'(WIDTH - 1) ? '0 : next_x + X_W'(1);
      if (next_x == X_W'(WIDTH - 1)) next_y <= next_y + Y_W'(1);
    end
  end
  // The complete light: the composite, with the open sheet blended into it.
  wire closed = held[CLOSED];
  wire [4*LIGHT_W-1:0] lit;
  fragment_read #(.COLOUR_W(HELD_W), .COLOUR_F(HELD_F), .OPACITY_W(THICK_W), .OPACITY_F(THICK_F)) read_all (
      .colours(closed ? held[COLOURS+:3*HELD_W] : blended_colours),
      .opacity(closed ? held[OPACITY+:THICK_W] : blended_opacity),
      .lit(lit)
  );
  assign h_data = {at_x, at_y, held[STATE_W-1:SHEET+SHEET_W], closed ? (SHEET + SHEET_W)'(0) : held[SHEET+SHEET_W-1:0], lit};
endmodule

`default_nettype wire
