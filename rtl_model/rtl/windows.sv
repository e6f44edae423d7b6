// Windows: stores at most `layers` slots per pixel as clusters of depth, and groups them into
// windows as late as possible. RTL implementation of units/fragment/window.rs.
//
//   s ->[ read the pixel ]->[ 1 a cluster spans it? ]-+- yes -> accumulate: sums += weight * attributes
//                           [ 2 its surface closed? ]-+- yes -> late: over its front, under its back (windows_late); or inside of it
//                           [ 3 slot free?          ]-+- yes -> insert, in the order of nearest depths
//                                                     +- no --> 4 windows, one slot per cycle -> 5 evict | 6 sum a pair | 7 close the two deepest
//   q -> shade -> a <-- slots that are closed
//
//   m <- outcome of each contribution        h <- after the last one: the windows of all pixels, shaded, each as a layer
//
// A contribution is taken in one cycle. In the next cycle its pixel is read and the outcome is
// decided, and HAZARD - 2 registers later the pixel is written: the same pixel can be taken again
// after HAZARD cycles, any other one in the next cycle. Blends, sums and closing occupy the unit
// for MERGE_CYCLES more cycles, as in the timing model, and while shade computes; the pixel is
// written in the last of these cycles.
//
// If no slot is free, windows are formed first: the slots are processed one per cycle, and each
// result has registers behind it, which synthesis may retime; so have the operands of blends. All
// of this shares one quotient, and nothing changes before the write. The number of registers
// follows from MERGE_CYCLES; elaboration requires at least the cycles that the operators take. In a
// single cycle the unit only decides whether a contribution occupies it, by comparisons of depths,
// and updates the visibility from slot to slot.
//
// Losses: each sum is rounded once per contribution (fragment_sum), and so are the sum of two
// slots, a blend into a closed slot, and each transmittance and quotient.
`timescale 1ns / 1ps
`default_nettype none

module windows #(
    parameter int WIDTH = 16,  // columns of stored pixels
    parameter int HEIGHT = 16, // rows of stored pixels
    parameter ROMS = "rom/"    // folder of the tables, with its slash
) (
    input wire clk,                                               // clock, rising edge
    input wire rst,                                               // empties all pixels
    // The frame's constants are those of all units: this one uses its thresholds.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constant while a frame is drawn
    // verilator lint_on UNUSEDSIGNAL
    input wire s_valid,                                           // a contribution is there
    output wire s_ready,                                          // and is taken
    input wire [machine_pkg::FRAGMENT_IN_W-1:0] s_data,           // the contribution
    output wire m_valid,                                          // a decision is there
    input wire m_ready,                                           // and is taken
    output wire [machine_pkg::FRAGMENT_OUT_W-1:0] m_data,         // the decision
    output wire q_valid,                                          // a request to shade a slot
    input wire q_ready,                                           // and is taken
    output wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] q_data,     // the slot
    input wire a_valid,                                           // its light is there
    output wire a_ready,                                          // and is taken
    input wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] a_data,       // the light
    input wire drain,                                             // the last contribution was taken: output all pixels
    output wire drained,                                          // everything was output and all pixels are empty, until drain falls
    output wire h_valid,                                          // a layer, or an empty pixel
    input wire h_ready,                                           // and is taken
    output wire h_last,                                           // it is its pixel's last
    output wire h_empty,                                          // an empty pixel: only x and y have a meaning
    output wire [machine_pkg::FRAGMENT_HELD_W-1:0] h_data         // the layer
);
  localparam int LAYERS = machine_pkg::FRAGMENT_LAYERS;
  localparam int LIVE_W = $clog2(LAYERS + 1);
  localparam int PIXELS = WIDTH * HEIGHT;
  localparam int PIXEL_W = PIXELS > 1 ? $clog2(PIXELS) : 1;
  localparam int X_W = machine_pkg::FRAGMENT_IN_X_W;
  localparam int Y_W = machine_pkg::FRAGMENT_IN_Y_W;
  localparam int SLOT_NUMBER_W = machine_pkg::FRAGMENT_OUT_SLOT_W;
  localparam int HAZARD = machine_pkg::FRAGMENT_HAZARD;
  localparam int MERGE_CYCLES = machine_pkg::FRAGMENT_MERGE_CYCLES;
  // Registers behind: the decision whether a slot joins a window, a quotient, the visibility of a
  // slot, the pair of least cost, and the blended values.
  localparam int SPARE = MERGE_CYCLES - LAYERS - 5;
  localparam int QUOTIENT_STAGES = SPARE / 4;
  localparam int STAGES = (SPARE - 2 * QUOTIENT_STAGES) / 4;
  localparam int BLEND_STAGES = SPARE - 2 * QUOTIENT_STAGES - 3 * STAGES;
  // Cycles from the decision that no slot is free to the pair.
  localparam int FORMING = LAYERS + 3 + QUOTIENT_STAGES + 3 * STAGES;
  localparam bit INTERVAL = machine_pkg::FRAGMENT_GROUP == machine_pkg::GROUP_INTERVAL;
  localparam bit LATE = machine_pkg::FRAGMENT_LATE != 0;
  localparam bit INSIDE = machine_pkg::FRAGMENT_INSIDE != 0;
  localparam bit EVICTS = machine_pkg::FRAGMENT_EVICT_HIDDEN != 0;

  localparam int GAUSS_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int ALPHA_W = machine_pkg::SPLAT_OPACITY_W;
  localparam int ALPHA_F = machine_pkg::SPLAT_OPACITY_F;
  localparam int N_W = machine_pkg::FRAGMENT_NORMAL_W;
  localparam int DENSITY_W = machine_pkg::FRAGMENT_WINDOW_DENSITY_W;
  localparam int MATERIAL_W = machine_pkg::FRAGMENT_IN_MATERIAL_W;
  localparam int DEPTH_W = machine_pkg::FRAGMENT_DEPTH_W;
  localparam int DEPTH_F = machine_pkg::FRAGMENT_DEPTH_F;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int WEIGHT_F = machine_pkg::FRAGMENT_WEIGHT_SUM_F;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int OPACITY_F = machine_pkg::FRAGMENT_OPACITY_SUM_F;
  localparam int NORMAL_W = machine_pkg::FRAGMENT_NORMAL_SUM_W;
  localparam int DEPTHS_W = machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_W;
  localparam int DEPTHS_F = machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_F;
  localparam int THROUGH_W = machine_pkg::FRAGMENT_WINDOW_THROUGH_W;
  localparam int THROUGH_F = machine_pkg::FRAGMENT_WINDOW_THROUGH_F;
  localparam int PART_W = machine_pkg::FRAGMENT_WINDOW_PART_W;
  localparam int PART_F = machine_pkg::FRAGMENT_WINDOW_PART_F;
  localparam int SHARE_F = machine_pkg::FRAGMENT_WINDOW_SHARE_F;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;
  localparam int LIGHT_F = machine_pkg::SHADE_PREMULTIPLIED_F;
  localparam [THROUGH_W-1:0] THROUGH_ONE = THROUGH_W'(1) << THROUGH_F;
  localparam [PART_W-1:0] PART_ONE = PART_W'(1) << PART_F;
  localparam [LIGHT_W-1:0] LIGHT_ONE = LIGHT_W'(1) << LIGHT_F;

  // A slot: whether it is closed, its nearest and farthest depth, material, weight, colours and
  // opacity. An open slot has sums of these, a closed one the sums of its light and the weight of
  // its front. Further fields of an open slot are the sums of depths and normals; those of a closed
  // slot are the end of its front and the beginning of its back, the back's weight, and the
  // transmittances behind the front and before the back.
  localparam int OPEN_W = DEPTHS_W + 3 * NORMAL_W;
  localparam int SHUT_W = 2 * DEPTH_W + WEIGHT_W + 2 * THROUGH_W;
  localparam int REST_W = OPEN_W > SHUT_W ? OPEN_W : SHUT_W;
  localparam int DEPTHS = 3 * NORMAL_W;
  localparam int BEHIND_FRONT = THROUGH_W;
  localparam int BACK_WEIGHT = 2 * THROUGH_W;
  localparam int BACK_NEAR = BACK_WEIGHT + WEIGHT_W;
  localparam int FRONT_FAR = BACK_NEAR + DEPTH_W;
  localparam int OPACITY = REST_W;
  localparam int COLOURS = OPACITY + OPACITY_W;
  localparam int WEIGHT = COLOURS + 3 * COLOUR_W;
  localparam int MATERIAL = WEIGHT + WEIGHT_W;
  localparam int FAR = MATERIAL + MATERIAL_W;
  localparam int NEAR = FAR + DEPTH_W;
  localparam int CLOSED = NEAR + DEPTH_W;
  localparam int SLOT_W = CLOSED + 1;
  localparam int SLOTS_W = LAYERS * SLOT_W;
  // The slots and the new one.
  localparam int PLACES = LAYERS + 1;
  localparam int PLACE_W = $clog2(PLACES + 1);
  localparam int STACK_W = PLACES * SLOT_W;
  // Fronts and backs.
  localparam int SIDES = 2 * LAYERS;

  localparam int OUTCOME_W = machine_pkg::FRAGMENT_OUT_OUTCOME_W;
  localparam [OUTCOME_W-1:0] ACCUMULATED = machine_pkg::OUTCOME_ACCUMULATED, INSERTED = machine_pkg::OUTCOME_INSERTED,
      EVICTED = machine_pkg::OUTCOME_EVICTED, LATE_FRONT = machine_pkg::OUTCOME_LATE_FRONT, LATE_BACK = machine_pkg::OUTCOME_LATE_BACK,
      LIES_INSIDE = machine_pkg::OUTCOME_INSIDE, SUMMED = machine_pkg::OUTCOME_SUMMED,
      CLOSED_BEHIND = machine_pkg::OUTCOME_CLOSED_BEHIND, CLOSED_INSIDE = machine_pkg::OUTCOME_CLOSED_INSIDE;

  // The slot of a stack that a one-hot vector selects, or 0 if it is zero.
  function automatic [SLOT_W-1:0] chosen(input [PLACES-1:0] choice, input [STACK_W-1:0] stack);
    integer at;
    begin
      chosen = '0;
      for (at = 0; at < PLACES; at = at + 1) if (choice[at]) chosen = chosen | stack[at*SLOT_W+:SLOT_W];
    end
  endfunction

  // The index of a one-hot bit.
  function automatic [SLOT_NUMBER_W-1:0] number(input [PLACES-1:0] choice);
    integer at;
    begin
      number = '0;
      for (at = 0; at < PLACES; at = at + 1) if (choice[at]) number = number | SLOT_NUMBER_W'(at);
    end
  endfunction

  // The number of set bits.
  function automatic [PLACE_W-1:0] count(input [PLACES-1:0] bits);
    integer at;
    begin
      count = '0;
      for (at = 0; at < PLACES; at = at + 1) count = count + PLACE_W'(bits[at]);
    end
  endfunction

  function automatic [DEPTH_W-1:0] nearer(input [DEPTH_W-1:0] one, input [DEPTH_W-1:0] other);
    nearer = one < other ? one : other;
  endfunction

  function automatic [DEPTH_W-1:0] farther(input [DEPTH_W-1:0] one, input [DEPTH_W-1:0] other);
    farther = one > other ? one : other;
  endfunction

  // Distance of a depth from a span; 0 inside it.
  function automatic [DEPTH_W-1:0] gap(input [DEPTH_W-1:0] near, input [DEPTH_W-1:0] far, input [DEPTH_W-1:0] z);
    gap = z < near ? near - z : z > far ? z - far : '0;
  endfunction

  // Whether a span extended by a depth is narrower than a width: it is between the depth less the
  // width and the depth plus the width. This also holds for a span that contains the depth, because
  // slots and their sides are narrower than a contribution may make them.
  function automatic spans(input [DEPTH_W-1:0] near, input [DEPTH_W-1:0] far, input signed [DEPTH_W+1:0] from, input [DEPTH_W:0] to);
    spans = $signed({2'b00, near}) > from && {1'b0, far} < to;
  endfunction

  // Whether one closed slot is behind the front of another and before its farthest depth.
  function automatic encloses(input [DEPTH_W-1:0] front_far, input [DEPTH_W-1:0] far, input [DEPTH_W-1:0] its_near, input [DEPTH_W-1:0] its_far);
    encloses = INSIDE && front_far < its_near && its_far < far;
  endfunction

  // The greatest power of two, from 1 down to 2^-8, that is at most the transmittance, one-hot,
  // with 1 as the first bit; zero if all are larger.
  localparam int POWERS = 9;
  function automatic [POWERS-1:0] power_of(input [THROUGH_W-1:0] seen);
    integer power;
    begin
      power_of = '0;
      for (power = POWERS - 1; power >= 0; power = power - 1) begin
        if (((THROUGH_W + POWERS)'(seen) << power) >= (THROUGH_W + POWERS)'(THROUGH_ONE)) power_of = POWERS'(1) << power;
      end
    end
  endfunction

  wire [DEPTH_W-1:0] z_threshold = frame[machine_pkg::FRAME_Z_THRESHOLD_LSB+:DEPTH_W];
  wire [DEPTH_W-1:0] reach = INTERVAL ? z_threshold : frame[machine_pkg::FRAME_REACH_LSB+:DEPTH_W];
  wire [WEIGHT_W-1:0] coverage_threshold = frame[machine_pkg::FRAME_COVERAGE_THRESHOLD_LSB+:WEIGHT_W];

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

  // The number of used slots, and the slots.
  localparam int STATE_W = LIVE_W + SLOTS_W;
  wire write;
  wire [PIXEL_W-1:0] write_pixel;
  wire [STATE_W-1:0] write_state;

  // A memory cannot be cleared at once, so touched pixels are marked in registers.
  logic [STATE_W-1:0] memory[0:PIXELS-1];
  logic [STATE_W-1:0] out;
  logic [PIXELS-1:0] touched;
  logic touched_out;
  wire empty_all;
  wire [STATE_W-1:0] read_state = memory[read_pixel];
  always_ff @(posedge clk) begin
    if (write) memory[write_pixel] <= write_state;
    if (read) out <= read_state;
    if (read) touched_out <= touched[read_pixel];
    if (rst || empty_all) touched <= '0;
    else if (write) touched[write_pixel] <= 1'b1;
  end

  // With a hazard of 1 a pixel is read in the cycle in which it is written.
  wire [STATE_W-1:0] state;
  if (HAZARD == 1) begin : g_forward
    logic [STATE_W-1:0] late_state;
    logic late_one;
    always_ff @(posedge clk) begin
      if (read) begin
        late_one <= write && write_pixel == read_pixel;
        late_state <= write_state;
      end
    end
    assign state = late_one ? late_state : touched_out ? out : '0;
  end else begin : g_stall
    assign state = touched_out ? out : '0;
  end
  wire [SLOTS_W-1:0] held = state[SLOTS_W-1:0];
  wire [LIVE_W-1:0] live = state[SLOTS_W+:LIVE_W];

  // Contribute: the contribution, and the current contents of its pixel.

  // Before the register: the depth, and the depth range in which a span stays narrow with it.
  wire [DEPTH_W-1:0] s_z;
  fit #(
      .IN_W(machine_pkg::FRAGMENT_IN_DEPTH_W),
      .PLACES(machine_pkg::RASTER_EXACT_DEPTH_F - DEPTH_F),
      .W(DEPTH_W),
      .S(machine_pkg::FRAGMENT_DEPTH_S),
      .ROUND(machine_pkg::FRAGMENT_DEPTH_ROUND),
      .WRAP(machine_pkg::FRAGMENT_DEPTH_WRAP)
  ) fit_depth (
      .exact($signed(s_data[machine_pkg::FRAGMENT_IN_DEPTH_LSB+:machine_pkg::FRAGMENT_IN_DEPTH_W])),
      .word(s_z)
  );

  logic taken;
  // The depth is stored in the comparators' word.
  // verilator lint_off UNUSEDSIGNAL
  logic [machine_pkg::FRAGMENT_IN_W-1:0] contribution;
  // verilator lint_on UNUSEDSIGNAL
  logic [PIXEL_W-1:0] pixel;
  logic [DEPTH_W-1:0] z;
  logic signed [DEPTH_W+1:0] reach_from, side_from;
  logic [DEPTH_W:0] reach_to, side_to;
  wire leave;
  always_ff @(posedge clk) begin
    taken <= !rst && (take || taken && !leave);
    if (take) begin
      contribution <= s_data;
      pixel <= read_pixel;
      z <= s_z;
      reach_from <= $signed({2'b00, s_z}) - $signed({2'b00, reach});
      reach_to <= {1'b0, s_z} + {1'b0, reach};
      side_from <= $signed({2'b00, s_z}) - $signed({2'b00, z_threshold});
      side_to <= {1'b0, s_z} + {1'b0, z_threshold};
    end
  end

  wire [X_W-1:0] x = contribution[machine_pkg::FRAGMENT_IN_X_LSB+:X_W];
  wire [Y_W-1:0] y = contribution[machine_pkg::FRAGMENT_IN_Y_LSB+:Y_W];
  wire [GAUSS_W-1:0] weight = contribution[machine_pkg::FRAGMENT_IN_WEIGHT_LSB+:GAUSS_W];
  wire [ALPHA_W-1:0] opacity = contribution[machine_pkg::FRAGMENT_IN_OPACITY_LSB+:ALPHA_W];
  wire [3*RGB_W-1:0] colour = contribution[machine_pkg::FRAGMENT_IN_BLUE_LSB+:3*RGB_W];
  wire [3*N_W-1:0] normal = contribution[machine_pkg::FRAGMENT_IN_NORMAL_Z_LSB+:3*N_W];
  wire [MATERIAL_W-1:0] material = contribution[machine_pkg::FRAGMENT_IN_MATERIAL_LSB+:MATERIAL_W];
  // 1, 2: the first of the nearest open slots that it joins; of the nearest sides that it is late
  // for; and the last slot around it.
  wire [LAYERS-1:0] there, joins_open, lies_in;
  wire [SIDES-1:0] late_sides;
  wire [LAYERS*DEPTH_W-1:0] open_gaps;
  wire [SIDES*DEPTH_W-1:0] side_gaps;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_match
    wire [SLOT_W-1:0] its = held[slot*SLOT_W+:SLOT_W];
    wire [DEPTH_W-1:0] near = its[NEAR+:DEPTH_W];
    wire [DEPTH_W-1:0] far = its[FAR+:DEPTH_W];
    wire [DEPTH_W-1:0] front_far = its[FRONT_FAR+:DEPTH_W];
    wire [DEPTH_W-1:0] back_near = its[BACK_NEAR+:DEPTH_W];
    wire closed = there[slot] && its[CLOSED];
    wire spanned = near <= z && z <= far;
    assign there[slot] = live > LIVE_W'(slot);
    assign open_gaps[slot*DEPTH_W+:DEPTH_W] = gap(near, far, z);
    assign joins_open[slot] = there[slot] && !its[CLOSED] && (spanned || spans(near, far, reach_from, reach_to));
    assign side_gaps[2*slot*DEPTH_W+:2*DEPTH_W] = {gap(back_near, far, z), gap(near, front_far, z)};
    assign late_sides[2*slot] = LATE && closed && spans(near, front_far, side_from, side_to);
    assign late_sides[2*slot+1] = LATE && closed && spans(back_near, far, side_from, side_to);
    assign lies_in[slot] = INSIDE && closed && near < z && z < far;
  end
  wire [LAYERS-1:0] found;
  wire [SIDES-1:0] late_side;
  windows_least #(.N(LAYERS), .W(DEPTH_W)) nearest_open (.counts(joins_open), .words(open_gaps), .least(found));
  windows_least #(.N(SIDES), .W(DEPTH_W)) nearest_side (.counts(late_sides), .words(side_gaps), .least(late_side));
  wire [LAYERS-1:0] late_front, late_back, around;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_side
    assign {late_back[slot], late_front[slot]} = late_side[2*slot+:2];
    // The last slot that contains it: no such slot is behind it.
    assign around[slot] = lies_in[slot] && (lies_in >> (slot + 1)) == '0;
  end
  // These decisions do not need the order of slots.
  wire matched = joins_open != '0;
  wire is_late = !matched && late_sides != '0;
  wire is_inside = !matched && late_sides == '0 && lies_in != '0;
  wire full = there[LAYERS-1];

  // Accumulate: the sums of the matching slot, or of a new one. Slots are passed as a whole,
  // whichever fields are used.
  // verilator lint_off UNUSEDSIGNAL
  wire [SLOT_W-1:0] was = chosen({1'b0, found}, {SLOT_W'(0), held});
  // verilator lint_on UNUSEDSIGNAL
  wire [SLOT_W-1:0] becomes;
  wire [DEPTHS_W-1:0] depths_become;
  wire [3*NORMAL_W-1:0] normals_become;
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(WEIGHT_F),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WEIGHT_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) weight_sum (
      .sum(was[WEIGHT+:WEIGHT_W]),
      .weight(weight),
      .attribute(1'b1),
      .next(becomes[WEIGHT+:WEIGHT_W])
  );
  fragment_sum #(
      .ATTRIBUTE_W(ALPHA_W),
      .ATTRIBUTE_F(ALPHA_F),
      .ATTRIBUTE_S(machine_pkg::SPLAT_OPACITY_S),
      .W(OPACITY_W),
      .F(OPACITY_F),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) opacity_sum (
      .sum(was[OPACITY+:OPACITY_W]),
      .weight(weight),
      .attribute(opacity),
      .next(becomes[OPACITY+:OPACITY_W])
  );
  fragment_sum #(
      .ATTRIBUTE_W(DEPTH_W),
      .ATTRIBUTE_F(DEPTH_F),
      .W(DEPTHS_W),
      .F(DEPTHS_F),
      .S(machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_WRAP)
  ) depth_sum (
      .sum(was[DEPTHS+:DEPTHS_W]),
      .weight(weight),
      .attribute(z),
      .next(depths_become)
  );
  for (genvar part = 0; part < 3; part++) begin : g_accumulate
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
        .sum(was[COLOURS+part*COLOUR_W+:COLOUR_W]),
        .weight(weight),
        .attribute(colour[part*RGB_W+:RGB_W]),
        .next(becomes[COLOURS+part*COLOUR_W+:COLOUR_W])
    );
    fragment_sum #(
        .ATTRIBUTE_W(N_W),
        .ATTRIBUTE_F(machine_pkg::FRAGMENT_NORMAL_F),
        .ATTRIBUTE_S(machine_pkg::FRAGMENT_NORMAL_S),
        .W(NORMAL_W),
        .F(machine_pkg::FRAGMENT_NORMAL_SUM_F),
        .S(machine_pkg::FRAGMENT_NORMAL_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_NORMAL_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_NORMAL_SUM_WRAP)
    ) normal_sum (
        .sum(was[part*NORMAL_W+:NORMAL_W]),
        .weight(weight),
        .attribute(normal[part*N_W+:N_W]),
        .next(normals_become[part*NORMAL_W+:NORMAL_W])
    );
  end
  assign becomes[CLOSED] = 1'b0;
  assign becomes[NEAR+:DEPTH_W] = matched ? nearer(was[NEAR+:DEPTH_W], z) : z;
  assign becomes[FAR+:DEPTH_W] = matched ? farther(was[FAR+:DEPTH_W], z) : z;
  assign becomes[MATERIAL+:MATERIAL_W] = matched ? was[MATERIAL+:MATERIAL_W] : material;
  assign becomes[REST_W-1:0] = REST_W'({depths_become, normals_become});

  // 3: all slots in the order of their nearest depths. Stable: the new one, the last, comes after
  // its equals. If a slot matched there is no new one, and the order is not used: its depth is then
  // the contribution's.
  wire [PLACES-1:0] stacked = {taken, there};
  wire [STACK_W-1:0] unsorted = {becomes, held};
  wire [PLACES*PLACES-1:0] comes;
  wire [PLACES-1:0] fresh_place;
  for (genvar one = 0; one < PLACES; one++) begin : g_rank
    wire [DEPTH_W-1:0] its_depth = one == LAYERS ? z : unsorted[one*SLOT_W+NEAR+:DEPTH_W];
    wire [PLACES-1:0] in_front;
    for (genvar other = 0; other < PLACES; other++) begin : g_in_front
      wire [DEPTH_W-1:0] other_depth = other == LAYERS ? z : unsorted[other*SLOT_W+NEAR+:DEPTH_W];
      assign in_front[other] = stacked[other] && (other_depth < its_depth || other_depth == its_depth && other < one);
    end
    wire [PLACE_W-1:0] rank = count(in_front);
    for (genvar place = 0; place < PLACES; place++) begin : g_place
      assign comes[place*PLACES+one] = stacked[one] && rank == PLACE_W'(place);
      if (one == LAYERS) begin : g_fresh
        assign fresh_place[place] = rank == PLACE_W'(place);
      end
    end
  end
  wire [STACK_W-1:0] sorted;
  for (genvar place = 0; place < PLACES; place++) begin : g_sorted
    assign sorted[place*SLOT_W+:SLOT_W] = chosen(comes[place*PLACES+:PLACES], unsorted);
  end

  // Processes of several cycles use these slots: an overflow, and the windows of a pixel at the
  // end.
  localparam [1:0] DECIDES = 2'd0, WALKS = 2'd1, JUDGES = 2'd2;
  localparam [1:0] FORMS = 2'd0, LIGHTS = 2'd1, PUTS = 2'd2, OFFERS = 2'd3;
  localparam int COUNT_W = $clog2(FORMING);
  logic [1:0] phase;
  logic [1:0] ends;
  logic busy;
  logic [STACK_W-1:0] stack;
  logic [SLOT_NUMBER_W-1:0] place;
  logic [COUNT_W-1:0] cycles;
  logic [PLACE_W-1:0] step;
  wire loads, steps, puts, lit_up, is_blended;
  wire deciding = taken && phase == DECIDES;
  wire judged = phase == JUDGES;
  wire judging = taken && judged;
  wire overflows = !matched && !is_late && !is_inside && full;
  always_ff @(posedge clk) begin
    if (rst || take) phase <= DECIDES;
    else if (deciding && overflows || loads) phase <= WALKS;
    else if (phase == WALKS && cycles == COUNT_W'(FORMING - 2)) phase <= JUDGES;
    if (deciding || loads) begin
      stack <= sorted;
      place <= number(fresh_place);
      step <= '0;
    end else if (steps) step <= step + PLACE_W'(1);
    if (deciding || loads || lit_up) cycles <= '0;
    else if (phase == WALKS || puts && !is_blended) cycles <= cycles + COUNT_W'(1);
  end
  wire [PLACES-1:0] at_slot = PLACES'(1) << (phase == WALKS ? cycles : COUNT_W'(step));
  wire [SLOT_W-1:0] slot_now = chosen(at_slot, stack);
  wire [DEPTH_W-1:0] near_now = slot_now[NEAR+:DEPTH_W];

  // 4: the slots before this one that could start a window that it joins: its mean depth is before
  // the window's end. And whether there is one.
  localparam int ENDS_F = WEIGHT_F + DEPTH_F;
  localparam int MEAN_UP = ENDS_F > DEPTHS_F ? ENDS_F - DEPTHS_F : 0;
  localparam int ENDS_UP = DEPTHS_F > ENDS_F ? DEPTHS_F - ENDS_F : 0;
  localparam int MEAN_W = WEIGHT_W + DEPTH_W + 1 + ENDS_UP > DEPTHS_W + MEAN_UP ? WEIGHT_W + DEPTH_W + 1 + ENDS_UP : DEPTHS_W + MEAN_UP;
  wire [WEIGHT_W-1:0] weight_now = slot_now[WEIGHT+:WEIGHT_W];
  wire [MEAN_W-1:0] mean = MEAN_W'(slot_now[DEPTHS+:DEPTHS_W]) << MEAN_UP;
  wire [LAYERS-1:0] lies_before_end, can_join;
  for (genvar earlier = 0; earlier < LAYERS; earlier++) begin : g_join
    wire [DEPTH_W:0] end_of_window = (DEPTH_W + 1)'(stack[earlier*SLOT_W+NEAR+:DEPTH_W]) + (DEPTH_W + 1)'(z_threshold);
    wire [MEAN_W-1:0] least_beyond = (MEAN_W'(weight_now) * MEAN_W'(end_of_window)) << ENDS_UP;
    assign lies_before_end[earlier] =
        !slot_now[CLOSED] && (weight_now == '0 ? (DEPTH_W + 1)'(near_now) < end_of_window : mean < least_beyond);
  end
  wire [PLACES-1:0] at_join;
  wire closed_joining;
  wire [WEIGHT_W-1:0] weight_joining;
  wire [OPACITY_W-1:0] opacity_joining;
  delay #(.W(PLACES + LAYERS + 1 + WEIGHT_W + OPACITY_W), .STAGES(STAGES)) join_stages (
      .clk(clk),
      .now({phase == WALKS ? at_slot : '0, lies_before_end, slot_now[CLOSED], weight_now, slot_now[OPACITY+:OPACITY_W]}),
      .late({at_join, can_join, closed_joining, weight_joining, opacity_joining})
  );
  logic growing;
  logic [PLACES-1:0] first;
  wire joins = growing && (first[LAYERS-1:0] & can_join) != '0;
  wire [PLACES-1:0] first_now = joins ? first : at_join;

  // Transmittances: of a window through those before it, and of a slot through the closed ones
  // before it.
  wire [PART_W-1:0] part;
  logic [THROUGH_W-1:0] through;
  logic [WEIGHT_W+3:0] window_weight;
  logic [OPACITY_W+3:0] window_opacity;
  wire ends_window;
  wire [PLACES-1:0] at_through;
  delay #(.W(PLACES + 1), .STAGES(QUOTIENT_STAGES)) quotient_stages (
      .clk(clk), .now({at_join, growing && !joins}), .late({at_through, ends_window}));
  wire [THROUGH_W-1:0] through_window;
  wire [PART_W-1:0] clear_part = PART_ONE - part;
  wire signed [THROUGH_W+PART_W+1:0] exact_through = $signed({1'b0, through}) * $signed({1'b0, clear_part});
  fit #(
      .IN_W(THROUGH_W + PART_W + 2),
      .PLACES(PART_F),
      .W(THROUGH_W),
      .S(0),
      .ROUND(machine_pkg::FRAGMENT_WINDOW_THROUGH_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_THROUGH_WRAP)
  ) fit_through (
      .exact(exact_through),
      .word(through_window)
  );
  logic [PLACES-1:0] at_seen;
  // verilator lint_off UNUSEDSIGNAL
  wire [SLOT_W-1:0] slot_through = chosen(at_through, stack);
  // verilator lint_on UNUSEDSIGNAL
  logic [DEPTH_W-1:0] near_seen;
  always_ff @(posedge clk) near_seen <= slot_through[NEAR+:DEPTH_W];
  for (genvar earlier = 0; earlier < LAYERS; earlier++) begin : g_seen
    wire [SLOT_W-1:0] its = stack[earlier*SLOT_W+:SLOT_W];
    wire [4*LIGHT_W-1:0] lit;
    wire [THROUGH_W-1:0] rest_now, seen_fitted;
    logic [THROUGH_W-1:0] rest;
    fragment_read read_slot (.colours(its[COLOURS+:3*COLOUR_W]), .opacity(its[OPACITY+:OPACITY_W]), .lit(lit));
    windows_rest of_light (.opacity(lit[LIGHT_W-1:0]), .through(rest_now));
    always_ff @(posedge clk) rest <= rest_now;
    wire unused_colours = &{1'b0, lit[4*LIGHT_W-1:LIGHT_W]};
    wire [THROUGH_W-1:0] behind = near_seen < its[FAR+:DEPTH_W] ? its[BEHIND_FRONT+:THROUGH_W] : rest;
    wire [THROUGH_W-1:0] seen_so_far, seen_on;
    if (earlier == 0) begin : g_first
      assign seen_so_far = through;
    end else begin : g_next
      assign seen_so_far = g_seen[earlier-1].seen_on;
    end
    wire signed [2*THROUGH_W+1:0] exact = $signed({1'b0, seen_so_far}) * $signed({1'b0, behind});
    fit #(
        .IN_W(2 * THROUGH_W + 2),
        .PLACES(THROUGH_F),
        .W(THROUGH_W),
        .S(0),
        .ROUND(machine_pkg::FRAGMENT_WINDOW_THROUGH_ROUND),
        .WRAP(machine_pkg::FRAGMENT_WINDOW_THROUGH_WRAP)
    ) fit_seen (
        .exact(exact),
        .word(seen_fitted)
    );
    assign seen_on = (at_seen >> (earlier + 1)) != '0 && its[CLOSED] ? seen_fitted : seen_so_far;
  end
  wire [PLACES-1:0] at_power;
  wire [THROUGH_W-1:0] seen_of_slot;
  delay #(.W(PLACES + THROUGH_W), .STAGES(STAGES)) seen_stages (
      .clk(clk), .now({at_seen, g_seen[LAYERS-1].seen_on}), .late({at_power, seen_of_slot}));
  // For each slot, the start of its window, and the power.
  wire [PLACES*PLACES-1:0] firsts;
  wire [PLACES*POWERS-1:0] powers;
  for (genvar slot = 0; slot < PLACES; slot++) begin : g_found
    logic [PLACES-1:0] its_first;
    logic [POWERS-1:0] its_power;
    always_ff @(posedge clk) begin
      if (at_join[slot]) its_first <= first_now;
      if (at_power[slot]) its_power <= power_of(seen_of_slot);
    end
    assign firsts[slot*PLACES+:PLACES] = its_first;
    assign powers[slot*POWERS+:POWERS] = its_power;
  end
  always_ff @(posedge clk) begin
    if (deciding || loads) begin
      growing <= 1'b0;
      through <= THROUGH_ONE;
    end else begin
      if (at_join != '0) growing <= !closed_joining;
      if (ends_window && at_through != '0) through <= through_window;
    end
    at_seen <= at_through;
    if (at_join != '0) begin
      first <= first_now;
      window_weight <= (joins ? window_weight : '0) + (WEIGHT_W + 4)'(weight_joining);
      window_opacity <= (joins ? window_opacity : '0) + (OPACITY_W + 4)'(opacity_joining);
    end
  end

  // 5: whether the deepest slot is invisible.
  wire hides_deepest = EVICTS && powers[LAYERS*POWERS+:POWERS] == '0;
  wire evicts;

  // 6: the pair of least cost; the nearer one to the eye among equals.
  localparam int COST_W = 2 * DEPTH_W + 2 + POWERS - 1;
  function automatic [COST_W-1:0] times_power(input [COST_W-1:0] whole, input [POWERS-1:0] power);
    integer at;
    begin
      times_power = '0;
      for (at = 0; at < POWERS; at = at + 1) if (power[at]) times_power = times_power | (whole << (POWERS - 1 - at));
    end
  endfunction
  // The start of a window is computed before its transmittance, by at least the cycles of a
  // quotient.
  wire [LAYERS-1:0] may_sum_now, may_sum;
  wire [LAYERS*COST_W-1:0] wholes, wholes_then, costs;
  delay #(.W(LAYERS + LAYERS * COST_W), .STAGES(QUOTIENT_STAGES)) cost_stages (
      .clk(clk), .now({may_sum_now, wholes}), .late({may_sum, wholes_then}));
  for (genvar front = 0; front < LAYERS; front++) begin : g_cost
    wire [SLOT_W-1:0] a = stack[front*SLOT_W+:SLOT_W];
    wire [SLOT_W-1:0] b = stack[(front+1)*SLOT_W+:SLOT_W];
    wire [DEPTH_W-1:0] far = farther(a[FAR+:DEPTH_W], b[FAR+:DEPTH_W]);
    wire [DEPTH_W-1:0] width = far - a[NEAR+:DEPTH_W];
    wire of_one = firsts[front*PLACES+:PLACES] == firsts[(front+1)*PLACES+:PLACES];
    // verilator lint_off UNUSEDSIGNAL
    wire [SLOT_W-1:0] starts = chosen(firsts[front*PLACES+:PLACES], stack);
    // verilator lint_on UNUSEDSIGNAL
    wire [DEPTH_W:0] reaches = (DEPTH_W + 1)'(z_threshold) + (DEPTH_W + 1)'(far - starts[NEAR+:DEPTH_W]);
    wire [COST_W-1:0] whole = of_one ? COST_W'(width) * COST_W'(reaches) : (COST_W'(z_threshold) * COST_W'(z_threshold)) << 1;
    assign wholes[front*COST_W+:COST_W] = whole;
    assign costs[front*COST_W+:COST_W] = times_power(wholes_then[front*COST_W+:COST_W], powers[front*POWERS+:POWERS]);
    assign may_sum_now[front] = !INTERVAL && !a[CLOSED] && !b[CLOSED] && width < z_threshold;
  end
  wire [LAYERS-1:0] cheapest, pair;
  windows_least #(.N(LAYERS), .W(COST_W)) least_cost (.counts(may_sum), .words(costs), .least(cheapest));
  delay #(.W(LAYERS + 1), .STAGES(STAGES)) judge_stages (.clk(clk), .now({hides_deepest, cheapest}), .late({evicts, pair}));
  wire sums_up = !evicts && pair != '0;

  // Two open slots in one: a pair, or, at the end, a window and the slot that joins it.
  logic [SLOT_W-1:0] window;
  // verilator lint_off UNUSEDSIGNAL
  wire [SLOT_W-1:0] addend = walking ? window : chosen({1'b0, pair}, stack);
  wire [SLOT_W-1:0] adder = walking ? slot_now : chosen({pair, 1'b0}, stack);
  // verilator lint_on UNUSEDSIGNAL
  wire [SLOT_W-1:0] summed;
  wire [DEPTHS_W-1:0] depths_summed;
  wire [3*NORMAL_W-1:0] normals_summed;
  windows_sum #(
      .W(WEIGHT_W),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) weight_of_two (
      .one(addend[WEIGHT+:WEIGHT_W]),
      .other(adder[WEIGHT+:WEIGHT_W]),
      .sum(summed[WEIGHT+:WEIGHT_W])
  );
  windows_sum #(
      .W(OPACITY_W),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) opacity_of_two (
      .one(addend[OPACITY+:OPACITY_W]),
      .other(adder[OPACITY+:OPACITY_W]),
      .sum(summed[OPACITY+:OPACITY_W])
  );
  windows_sum #(
      .W(DEPTHS_W),
      .S(machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_S),
      .WRAP(machine_pkg::FRAGMENT_WINDOW_DEPTH_SUM_WRAP)
  ) depth_of_two (
      .one(addend[DEPTHS+:DEPTHS_W]),
      .other(adder[DEPTHS+:DEPTHS_W]),
      .sum(depths_summed)
  );
  for (genvar lane = 0; lane < 3; lane++) begin : g_of_two
    windows_sum #(
        .W(COLOUR_W),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) colour_of_two (
        .one(addend[COLOURS+lane*COLOUR_W+:COLOUR_W]),
        .other(adder[COLOURS+lane*COLOUR_W+:COLOUR_W]),
        .sum(summed[COLOURS+lane*COLOUR_W+:COLOUR_W])
    );
    windows_sum #(
        .W(NORMAL_W),
        .S(machine_pkg::FRAGMENT_NORMAL_SUM_S),
        .WRAP(machine_pkg::FRAGMENT_NORMAL_SUM_WRAP)
    ) normal_of_two (
        .one(addend[lane*NORMAL_W+:NORMAL_W]),
        .other(adder[lane*NORMAL_W+:NORMAL_W]),
        .sum(normals_summed[lane*NORMAL_W+:NORMAL_W])
    );
  end
  assign summed[CLOSED] = 1'b0;
  assign summed[NEAR+:DEPTH_W] = nearer(addend[NEAR+:DEPTH_W], adder[NEAR+:DEPTH_W]);
  assign summed[FAR+:DEPTH_W] = farther(addend[FAR+:DEPTH_W], adder[FAR+:DEPTH_W]);
  assign summed[MATERIAL+:MATERIAL_W] = addend[MATERIAL+:MATERIAL_W];
  assign summed[REST_W-1:0] = REST_W'({depths_summed, normals_summed});

  // 2: the blended values of the contribution.
  logic [GAUSS_W-1:0] blended_weight;
  logic [ALPHA_W-1:0] blended_opacity;
  logic [3*RGB_W-1:0] blended_light;
  logic [DENSITY_W-1:0] blended_density;
  always_ff @(posedge clk) begin
    blended_weight <= weight;
    blended_opacity <= opacity;
    blended_light <= contribution[machine_pkg::FRAGMENT_IN_LIGHT_B_LSB+:3*RGB_W];
    blended_density <= contribution[machine_pkg::FRAGMENT_IN_DENSITY_LSB+:DENSITY_W];
  end

  // 2, 7: the closed slot to which a contribution is added at once, and how; after windows, the two
  // deepest. Both are available long before they are blended: a contribution added at once takes at
  // least as many cycles as windows. This number of registers is before the quotient.
  wire [LAYERS-1:0] late_slot = late_front | late_back;
  wire to_back_now = late_back != '0;
  wire [SLOT_W-1:0] closed_now =
      phase == DECIDES ? chosen({1'b0, is_late ? late_slot : around}, {SLOT_W'(0), held}) : stack[(LAYERS-1)*SLOT_W+:SLOT_W];
  wire adds_late, to_back;
  wire [SLOT_W-1:0] was_closed, deepest;
  delay #(.W(SLOT_W + 2), .STAGES(LAYERS)) closed_stages (
      .clk(clk), .now({phase == DECIDES && is_late, to_back_now, closed_now}), .late({adds_late, to_back, was_closed}));
  delay #(.W(SLOT_W), .STAGES(2)) deepest_stages (.clk(clk), .now(stack[LAYERS*SLOT_W+:SLOT_W]), .late(deepest));

  // 7: the two deepest are shaded, the back one first, once each; at the end, each window.
  wire closes = judging && !evicts && !sums_up;
  logic [SLOT_W-1:0] shaded;
  always_ff @(posedge clk) shaded <= walking ? window : was_closed;
  wire ask_back = !deepest[CLOSED];
  wire ask_front = !shaded[CLOSED];
  logic asked_back, asked_front, here_back;
  logic [machine_pkg::FRAGMENT_ANSWER_W-1:0] light_back, light_front;
  wire lighting = walking && busy && ends == LIGHTS;
  wire asks_back = closes && ask_back && !asked_back;
  wire asks_front = (closes || lighting) && ask_front && !asked_front;
  assign q_valid = asks_back || asks_front;
  // verilator lint_off UNUSEDSIGNAL
  wire [SLOT_W-1:0] asked = asks_back ? deepest : shaded;
  // verilator lint_on UNUSEDSIGNAL
  // Weight, colours and opacity are adjacent.
  assign q_data = {asked[MATERIAL-1:OPACITY], asked[3*NORMAL_W-1:0], asked[MATERIAL+:MATERIAL_W]};

  // A response is the back slot's until that has arrived.
  wire is_back = !walking && ask_back && !here_back;
  wire awaits_back = closes && is_back;
  wire complete = awaits_back ? a_valid && !ask_front : a_valid || !ask_front;
  assign lit_up = lighting && (a_valid || !ask_front);
  assign a_ready = lighting || closes && (awaits_back && ask_front || leave && (awaits_back || ask_front));
  always_ff @(posedge clk) begin
    if (rst || leave || lit_up) begin
      asked_back <= 1'b0;
      asked_front <= 1'b0;
      here_back <= 1'b0;
    end else begin
      if (q_valid && q_ready) begin
        if (asks_back) asked_back <= 1'b1;
        else asked_front <= 1'b1;
      end
      if (closes && a_valid && a_ready) here_back <= 1'b1;
    end
    // A request that is not taken yet stays, and is the same in the next cycle.
    if (a_valid && is_back) light_back <= a_data;
    if (a_valid && !is_back) light_front <= a_data;
  end
  // verilator lint_off UNUSEDSIGNAL
  wire [SLOT_W-1:0] shut_back, shut_front;
  // verilator lint_on UNUSEDSIGNAL
  windows_close #(
      .SLOT_W(SLOT_W),
      .REST_W(REST_W)
  ) close_back (
      .slot(deepest),
      .light(light_back),
      .shut(shut_back)
  );
  windows_close #(
      .SLOT_W(SLOT_W),
      .REST_W(REST_W)
  ) close_front (
      .slot(shaded),
      .light(light_front),
      .shut(shut_front)
  );

  // One closed slot behind another.
  wire [4*LIGHT_W-1:0] over, under;
  fragment_read read_over (.colours(shut_front[COLOURS+:3*COLOUR_W]), .opacity(shut_front[OPACITY+:OPACITY_W]), .lit(over));
  fragment_read read_under (.colours(shut_back[COLOURS+:3*COLOUR_W]), .opacity(shut_back[OPACITY+:OPACITY_W]), .lit(under));
  wire [SLOT_W-1:0] behind;
  for (genvar channel = 0; channel < 3; channel++) begin : g_blend
    fragment_over #(
        .W(COLOUR_W),
        .F(machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) blend_colour (
        .front(over[(channel+1)*LIGHT_W+:LIGHT_W]),
        .back(under[(channel+1)*LIGHT_W+:LIGHT_W]),
        .opacity(over[LIGHT_W-1:0]),
        .word(behind[COLOURS+channel*COLOUR_W+:COLOUR_W])
    );
  end
  fragment_over #(
      .W(OPACITY_W),
      .F(OPACITY_F),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) blend_opacity (
      .front(over[LIGHT_W-1:0]),
      .back(under[LIGHT_W-1:0]),
      .opacity(over[LIGHT_W-1:0]),
      .word(behind[OPACITY+:OPACITY_W])
  );
  wire [LIGHT_W-1:0] clear_over = over[LIGHT_W-1:0] > LIGHT_ONE ? '0 : LIGHT_ONE - over[LIGHT_W-1:0];
  wire [THROUGH_W-1:0] before_back;
  windows_dimmed dimmed (.through(shut_back[THROUGH_W-1:0]), .clear(clear_over), .next(before_back));
  // Its back is that of the deeper one, if that ends later.
  wire ends_behind = shut_back[FAR+:DEPTH_W] > shut_front[FAR+:DEPTH_W];
  assign behind[CLOSED] = 1'b1;
  assign behind[NEAR+:DEPTH_W] = shut_front[NEAR+:DEPTH_W];
  assign behind[FAR+:DEPTH_W] = ends_behind ? shut_back[FAR+:DEPTH_W] : shut_front[FAR+:DEPTH_W];
  assign behind[MATERIAL-1:WEIGHT] = shut_front[MATERIAL-1:WEIGHT];
  assign behind[MATERIAL+:MATERIAL_W] = shut_front[MATERIAL+:MATERIAL_W];
  assign behind[REST_W-1:0] = REST_W'({
    shut_front[FRONT_FAR+:DEPTH_W],
    ends_behind ? shut_back[BACK_WEIGHT+:DEPTH_W+WEIGHT_W] : shut_front[BACK_WEIGHT+:DEPTH_W+WEIGHT_W],
    shut_front[BEHIND_FRONT+:THROUGH_W],
    ends_behind ? before_back : shut_front[THROUGH_W-1:0]
  });

  // The quotient: of a window's opacity, of a late contribution, and of an inside one.
  localparam int NINE_W = (WEIGHT_W > OPACITY_W ? WEIGHT_W : OPACITY_W) + 4;
  localparam int OF_LATE_W = WEIGHT_W + ALPHA_W + ALPHA_F;
  localparam int OF_INSIDE_W = LIGHT_W + THROUGH_W;
  localparam int BOTH_W = NINE_W > OF_LATE_W ? NINE_W : OF_LATE_W;
  localparam int QUOTIENT_W = BOTH_W > OF_INSIDE_W ? BOTH_W : OF_INSIDE_W;
  localparam int PLACES_W = 9;
  localparam signed [PLACES_W-1:0] OF_WINDOW = PLACES_W'(OPACITY_F - SHARE_F - WEIGHT_F), OF_LATE = PLACES_W'(-SHARE_F),
      OF_INSIDE = PLACES_W'(THROUGH_F - SHARE_F);
  wire [QUOTIENT_W-1:0] numerator_late, denominator_late, numerator_inside, denominator_inside;
  wire [QUOTIENT_W-1:0] most = QUOTIENT_W'(window_weight) > QUOTIENT_W'(coverage_threshold)
      ? QUOTIENT_W'(window_weight) : QUOTIENT_W'(coverage_threshold);
  wire is_window = phase == WALKS;
  wire [PART_W-1:0] part_now;
  windows_quotient #(
      .W(QUOTIENT_W),
      .PLACES_W(PLACES_W),
      .ROM({ROMS, "fragment.window.reciprocal.hex"})
  ) quotient (
      .numerator(is_window ? QUOTIENT_W'(window_opacity) : adds_late ? numerator_late : numerator_inside),
      .denominator(is_window ? most : adds_late ? denominator_late : denominator_inside),
      .places(is_window ? OF_WINDOW : adds_late ? OF_LATE : OF_INSIDE),
      .part(part_now)
  );
  delay #(.W(PART_W), .STAGES(QUOTIENT_STAGES)) part_stages (.clk(clk), .now(part_now), .late(part));

  // 2: a late contribution to one side of a closed slot.
  wire [SLOT_W-1:0] becomes_late;
  wire [WEIGHT_W-1:0] late_weight;
  wire [2*THROUGH_W-1:0] late_through;
  windows_late #(
      .QUOTIENT_W(QUOTIENT_W)
  ) late (
      .back(to_back),
      .weight(blended_weight),
      .alpha(blended_opacity),
      .light(blended_light),
      .threshold(coverage_threshold),
      .had(to_back ? was_closed[BACK_WEIGHT+:WEIGHT_W] : was_closed[WEIGHT+:WEIGHT_W]),
      .colours(was_closed[COLOURS+:3*COLOUR_W]),
      .opacity(was_closed[OPACITY+:OPACITY_W]),
      .through(was_closed[2*THROUGH_W-1:0]),
      .numerator(numerator_late),
      .denominator(denominator_late),
      .share(part),
      .next_weight(late_weight),
      .next_colours(becomes_late[COLOURS+:3*COLOUR_W]),
      .next_opacity(becomes_late[OPACITY+:OPACITY_W]),
      .next_through(late_through)
  );
  assign becomes_late[CLOSED] = 1'b1;
  assign becomes_late[NEAR+:DEPTH_W] = to_back ? was_closed[NEAR+:DEPTH_W] : nearer(was_closed[NEAR+:DEPTH_W], z);
  assign becomes_late[FAR+:DEPTH_W] = to_back ? farther(was_closed[FAR+:DEPTH_W], z) : was_closed[FAR+:DEPTH_W];
  assign becomes_late[MATERIAL+:MATERIAL_W] = was_closed[MATERIAL+:MATERIAL_W];
  assign becomes_late[WEIGHT+:WEIGHT_W] = to_back ? was_closed[WEIGHT+:WEIGHT_W] : late_weight;
  assign becomes_late[REST_W-1:0] = REST_W'({
    to_back ? was_closed[FRONT_FAR+:DEPTH_W] : farther(was_closed[FRONT_FAR+:DEPTH_W], z),
    to_back ? nearer(was_closed[BACK_NEAR+:DEPTH_W], z) : was_closed[BACK_NEAR+:DEPTH_W],
    to_back ? late_weight : was_closed[BACK_WEIGHT+:WEIGHT_W],
    late_through
  });

  // 2, 7: an inside blend into a closed slot: a contribution, the deepest slot, or, at the end, a
  // window. The last layer is available long before the next window.
  logic [SLOT_W-1:0] last, last_before;
  always_ff @(posedge clk) last_before <= last;
  wire [4*LIGHT_W-1:0] splat_lit;
  windows_splat #(.ROMS(ROMS)) splat (.weight(blended_weight), .density(blended_density), .light(blended_light), .lit(splat_lit));
  wire [SLOT_W-1:0] outer = walking ? last_before : judged ? shut_front : was_closed;
  wire [DEPTH_W-1:0] inner_near = walking ? shaded[NEAR+:DEPTH_W] : judged ? shut_back[NEAR+:DEPTH_W] : z;
  wire [DEPTH_W-1:0] inner_far = walking ? shaded[FAR+:DEPTH_W] : judged ? shut_back[FAR+:DEPTH_W] : z;
  wire [DEPTH_W:0] twice_inner = (DEPTH_W + 1)'(inner_near) + (DEPTH_W + 1)'(inner_far);
  wire [DEPTH_W:0] twice_middle = (DEPTH_W + 1)'(outer[FRONT_FAR+:DEPTH_W]) + (DEPTH_W + 1)'(outer[BACK_NEAR+:DEPTH_W]);
  wire [SLOT_W-1:0] becomes_inside;
  wire [THROUGH_W-1:0] inside_before_back;
  windows_inside #(
      .QUOTIENT_W(QUOTIENT_W)
  ) inside_of (
      .colours(outer[COLOURS+:3*COLOUR_W]),
      .opacity(outer[OPACITY+:OPACITY_W]),
      .behind_front(outer[BEHIND_FRONT+:THROUGH_W]),
      .before_back(outer[THROUGH_W-1:0]),
      .nearer_back(twice_inner >= twice_middle),
      .x(walking ? over : judged ? under : splat_lit),
      .numerator(numerator_inside),
      .denominator(denominator_inside),
      .lost(part),
      .next_colours(becomes_inside[COLOURS+:3*COLOUR_W]),
      .next_opacity(becomes_inside[OPACITY+:OPACITY_W]),
      .next_before_back(inside_before_back)
  );
  assign becomes_inside[SLOT_W-1:WEIGHT] = outer[SLOT_W-1:WEIGHT];
  assign becomes_inside[REST_W-1:0] = {outer[REST_W-1:THROUGH_W], inside_before_back};

  // The outcome of the contribution.
  wire is_closed_inside = encloses(
      shut_front[FRONT_FAR+:DEPTH_W], shut_front[FAR+:DEPTH_W], shut_back[NEAR+:DEPTH_W], shut_back[FAR+:DEPTH_W]);
  wire [OUTCOME_W-1:0] outcome_at_once =
      matched ? ACCUMULATED : is_late ? (to_back_now ? LATE_BACK : LATE_FRONT) : is_inside ? LIES_INSIDE : INSERTED;
  wire [OUTCOME_W-1:0] outcome_in_the_end = evicts ? EVICTED : sums_up ? SUMMED : is_closed_inside ? CLOSED_INSIDE : CLOSED_BEHIND;
  wire [OUTCOME_W-1:0] outcome = judging ? outcome_in_the_end : outcome_at_once;
  wire [LAYERS-1:0] changed_slot = matched ? found : is_late ? late_slot : around;
  wire [SLOT_NUMBER_W-1:0] slot_at_once = matched || is_late || is_inside ? number({1'b0, changed_slot}) : number(fresh_place);
  wire [SLOT_NUMBER_W-1:0] slot_in_the_end =
      evicts ? SLOT_NUMBER_W'(place == SLOT_NUMBER_W'(LAYERS)) : sums_up ? number({1'b0, pair}) : SLOT_NUMBER_W'(LAYERS - 1);
  wire [SLOT_NUMBER_W-1:0] decided_slot = judging ? slot_in_the_end : slot_at_once;
  wire [SLOT_NUMBER_W-1:0] decided_place = judging && !evicts ? place : '0;

  // The outcome of the slot that is blended, summed or closed; at the end, of a layer with a window
  // inside it.
  wire [SLOT_W-1:0] changed_in_the_end = sums_up ? summed : is_closed_inside ? becomes_inside : behind;
  wire [SLOT_W-1:0] changed_at_once = adds_late ? becomes_late : becomes_inside;
  wire [SLOT_W-1:0] changed;
  delay #(.W(SLOT_W), .STAGES(BLEND_STAGES)) blend_stages (
      .clk(clk), .now(walking ? becomes_inside : judged ? changed_in_the_end : changed_at_once), .late(changed));

  wire settles;
  wire [SLOTS_W-1:0] decided_slots;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_decided
    // Slots behind a summed pair move up by one.
    wire behind_pair = sums_up && (pair & LAYERS'((1 << slot) - 1)) != '0;
    wire [SLOT_W-1:0] stays = behind_pair ? stack[(slot+1)*SLOT_W+:SLOT_W] : stack[slot*SLOT_W+:SLOT_W];
    wire closes_here = !evicts && !sums_up && slot == LAYERS - 1;
    wire [SLOT_W-1:0] in_the_end = sums_up && pair[slot] || closes_here ? changed : stays;
    wire [SLOT_W-1:0] its = held[slot*SLOT_W+:SLOT_W];
    wire [SLOT_W-1:0] at_once = !matched ? sorted[slot*SLOT_W+:SLOT_W] : found[slot] ? becomes : its;
    assign decided_slots[slot*SLOT_W+:SLOT_W] = !settles ? at_once : judged ? in_the_end : changed_slot[slot] ? changed : its;
  end
  wire [LIVE_W-1:0] decided_live = matched || settles ? live : live + LIVE_W'(1);

  wire merges = judging || is_late || is_inside;
  wire under_way;
  wire room;
  fragment_late #(
      .W(PIXEL_W + STATE_W),
      .HAZARD(HAZARD)
  ) write_late (
      .clk(clk),
      .rst(rst),
      .decided(leave && !merges || settles),
      .decision({pixel, decided_live, decided_slots}),
      .write(write),
      .written({write_pixel, write_state}),
      .under_way(under_way)
  );

  // Blends, sums, closing and evictions occupy the unit until their last cycle; any other
  // contribution has left when the next one comes. Comparisons of several cycles occupy it in any
  // case, so their results are not needed here.
  wire free = deciding && !overflows && room && !is_late && !is_inside;
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
  // The remaining cycles, without those of windows. The pixel is written in the last of them.
  localparam int REST_COUNT_W = $clog2(MERGE_CYCLES);
  logic [REST_COUNT_W-1:0] rest_cycles;
  always_ff @(posedge clk) begin
    if (rst) rest_cycles <= '0;
    else if (leave && merges) rest_cycles <= judging ? REST_COUNT_W'(MERGE_CYCLES - 1 - FORMING) : REST_COUNT_W'(MERGE_CYCLES - 1);
    else if (rests) rest_cycles <= rest_cycles - REST_COUNT_W'(1);
  end
  assign rests = rest_cycles != '0;
  assign settles = rest_cycles == REST_COUNT_W'(1);

  // Output of the decision: the remaining latency of the unit.
  localparam int REST_OF_LATENCY = machine_pkg::FRAGMENT_LATENCY > 1 ? machine_pkg::FRAGMENT_LATENCY - 1 : 1;
  localparam int REST_OF_ROOM = machine_pkg::FRAGMENT_LATENCY > 1 ? machine_pkg::FRAGMENT_ROOM - 1 : machine_pkg::FRAGMENT_ROOM;
  wire decided = deciding && !overflows || judging && (!closes || complete);
  pipe #(
      .W(machine_pkg::FRAGMENT_OUT_W),
      .LATENCY(REST_OF_LATENCY),
      .INTERVAL(1),
      .ROOM(REST_OF_ROOM)
  ) decisions (
      .clk(clk),
      .rst(rst),
      .s_valid(decided),
      .s_ready(room),
      .s_keeps(1'b1),
      .s_data({x, y, outcome, decided_slot, decided_place}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  assign leave = decided && room;
  logic done;
  assign s_ready = !walking && !done && !rests && !(s_valid && waits) && (!taken || free);

  // Walk: the windows of all pixels, row by row. A pixel is read and sorted, and its windows are
  // formed. The slots of a window are added and the window is shaded. It is then either blended
  // inside the layer before it, or a new layer, and the previous layer is output.

  wire begins = drain && !s_valid && !taken && !rests && !under_way && !walking && !done;
  logic [X_W-1:0] at_x;
  logic [Y_W-1:0] at_y;
  logic here;
  logic has_last;
  logic adds;
  logic [PLACES-1:0] window_first;
  logic [SLOT_NUMBER_W-1:0] last_first;
  wire [PLACE_W-1:0] live_places = PLACE_W'(live);
  wire empty = walking && here && live == '0;
  wire forms = walking && busy && judged && ends == FORMS;
  assign puts = walking && busy && ends == PUTS;
  wire offers = walking && busy && ends == OFFERS;
  wire [PLACES-1:0] first_of_slot;
  for (genvar one = 0; one < PLACES; one++) begin : g_first
    wire [PLACES-1:0] starts;
    for (genvar slot = 0; slot < PLACES; slot++) begin : g_slot
      assign starts[slot] = at_slot[slot] && firsts[slot*PLACES+one];
    end
    assign first_of_slot[one] = starts != '0;
  end
  wire goes_on = forms && step < live_places && (!adds || first_of_slot == window_first);
  wire is_within =
      has_last && encloses(last[FRONT_FAR+:DEPTH_W], last[FAR+:DEPTH_W], window[NEAR+:DEPTH_W], window[FAR+:DEPTH_W]);
  assign is_blended = puts && cycles == COUNT_W'(QUOTIENT_STAGES + BLEND_STAGES);
  wire hands_out = is_blended && has_last && !is_within;
  wire put = is_blended && (!hands_out || h_ready);
  assign loads = walking && here && !busy && live != '0;
  assign steps = goes_on;
  assign h_valid = empty || hands_out || offers;
  assign h_empty = empty;
  assign h_last = empty || offers;
  wire next = walking && (!here || h_ready && h_last);
  wire over_all = next_y == Y_W'(HEIGHT);
  assign walk_on = next && !over_all;
  assign empty_all = next && over_all;
  assign drained = done;
  always_ff @(posedge clk) begin
    if (rst) begin
      walking <= 1'b0;
      done <= 1'b0;
      busy <= 1'b0;
    end else begin
      walking <= begins || walking && !empty_all;
      done <= drain && (done || empty_all);
      busy <= loads || busy && !next;
    end
    if (begins) begin
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
    if (loads) begin
      ends <= FORMS;
      has_last <= 1'b0;
      adds <= 1'b0;
    end
    if (goes_on) begin
      window <= adds ? summed : slot_now;
      window_first <= first_of_slot;
      adds <= 1'b1;
    end else if (forms) ends <= LIGHTS;
    if (lit_up) ends <= PUTS;
    if (put) begin
      has_last <= 1'b1;
      last <= is_within ? changed : shut_front;
      if (!is_within) last_first <= number(window_first);
      adds <= 1'b0;
      ends <= step < live_places ? FORMS : OFFERS;
    end
  end
  wire [4*LIGHT_W-1:0] lit_last;
  fragment_read read_last (.colours(last[COLOURS+:3*COLOUR_W]), .opacity(last[OPACITY+:OPACITY_W]), .lit(lit_last));
  assign h_data = {at_x, at_y, last_first, last[NEAR+:DEPTH_W], lit_last};
endmodule

`default_nettype wire
