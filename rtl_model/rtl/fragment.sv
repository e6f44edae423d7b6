// Fragment: stores at most `layers` fragments per pixel: accumulates, inserts, merges, evicts. RTL
// implementation of units/fragment.rs.
//
//   s ->[ read the pixel ]->[ match: unshaded, |z - z_f| < eps, nearest ]-+- found ----> accumulate: sums += weight * attributes
//                                                                         +- slot free -> insert
//                                                                         +- full ------> evict the deepest if something hides it,
//                             q -> shade -> a <-- two fragments --------------------------- else merge a pair, front over back
//
//   m <- outcome of each contribution        h <- after the last one: contents of all pixels
//
// A contribution is taken in one cycle. In the next cycle its pixel is read and the outcome is
// decided. HAZARD - 2 registers later, which synthesis may retime into sums and products, the pixel
// is written. The same pixel can therefore be taken again after HAZARD cycles, any other one in the
// next cycle. While two fragments are shaded and merged no contribution is taken: s_ready depends
// on this in the same cycle, as in the timing model.
//
// This is the unit's shortest loop: are two merged ->[ s_ready ]-> the next contribution is taken,
// read and compared. As much as possible is therefore computed before the registers: the depth
// range of a match, whether each slot is opaque, and whether the contribution alone is. The logic
// behind the registers only decides whether a slot matches, and whether an opaque slot is in front
// of the deepest. The nearest slot, the sums, the order and the pair are only in the loop of the
// pixel, which has HAZARD registers.
//
// Losses: each sum is rounded once per contribution (fragment_sum), and so is the result of a merge
// (fragment_over). The depth is truncated to the comparators' word. A light is truncated to the
// word of a slot, and a slot's content to the word of a light.
`timescale 1ns / 1ps
`default_nettype none

module fragment #(
    parameter int WIDTH = 16, // columns of stored pixels
    parameter int HEIGHT = 16 // rows of stored pixels
) (
    input wire clk,                                               // clock, rising edge
    input wire rst,                                               // empties all pixels
    // The frame's constants are those of all units: this one uses its two thresholds.
    // verilator lint_off UNUSEDSIGNAL
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constant while a frame is drawn
    // verilator lint_on UNUSEDSIGNAL
    input wire s_valid,                                           // a contribution is there
    output wire s_ready,                                          // and is taken
    input wire [machine_pkg::FRAGMENT_IN_W-1:0] s_data,           // the contribution
    output wire m_valid,                                          // a decision is there
    input wire m_ready,                                           // and is taken
    output wire [machine_pkg::FRAGMENT_OUT_W-1:0] m_data,         // the decision
    output wire q_valid,                                          // a request to shade a fragment
    input wire q_ready,                                           // and is taken
    output wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] q_data,     // the fragment
    input wire a_valid,                                           // its light is there
    output wire a_ready,                                          // and is taken
    input wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] a_data,       // the light
    input wire drain,                                             // the last contribution was taken: output all pixels
    output wire drained,                                          // everything was output and all pixels are empty, until drain falls
    output wire h_valid,                                          // a stored fragment, or an empty pixel
    input wire h_ready,                                           // and is taken
    output wire h_last,                                           // it is its pixel's last
    output wire h_empty,                                          // an empty pixel: only x and y have a meaning
    output wire [machine_pkg::FRAGMENT_HELD_W-1:0] h_data         // the fragment
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

  localparam int GAUSS_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int RGB_W = machine_pkg::SPLAT_RGB_W;
  localparam int ALPHA_W = machine_pkg::SPLAT_OPACITY_W;
  localparam int N_W = machine_pkg::FRAGMENT_NORMAL_W;
  localparam int MATERIAL_W = machine_pkg::FRAGMENT_IN_MATERIAL_W;
  localparam int DEPTH_W = machine_pkg::FRAGMENT_DEPTH_W;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int COLOUR_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int OPACITY_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int NORMAL_W = machine_pkg::FRAGMENT_NORMAL_SUM_W;
  localparam int LIGHT_W = machine_pkg::SHADE_PREMULTIPLIED_W;

  // A slot: whether it is shaded, its depth, and the fields of a request to shade: sums and
  // material. A shaded slot has its premultiplied colour and its opacity in the place of their
  // sums, and 0 in the other sums.
  localparam int ASKED_W = machine_pkg::FRAGMENT_REQUEST_WEIGHT_LSB + machine_pkg::FRAGMENT_REQUEST_WEIGHT_W;
  localparam int DEPTH = ASKED_W;
  localparam int SHADED = DEPTH + DEPTH_W;
  localparam int SLOT_W = SHADED + 1;
  localparam int SLOTS_W = LAYERS * SLOT_W;
  localparam int WEIGHT = machine_pkg::FRAGMENT_REQUEST_WEIGHT_LSB;
  localparam int OPACITY = machine_pkg::FRAGMENT_REQUEST_OPACITY_LSB;
  localparam int MATERIAL = machine_pkg::FRAGMENT_REQUEST_MATERIAL_LSB;
  // Blue is the last colour, and z the last component of the normal.
  localparam int COLOURS = machine_pkg::FRAGMENT_REQUEST_COLOUR_B_LSB;
  localparam int NORMALS = machine_pkg::FRAGMENT_REQUEST_NORMAL_Z_LSB;
  // The slots and the new fragment.
  localparam int PLACES = LAYERS + 1;
  localparam int PLACE_W = $clog2(PLACES);
  localparam int STACK_W = PLACES * SLOT_W;

  localparam [machine_pkg::FRAGMENT_OUT_OUTCOME_W-1:0] ACCUMULATED = machine_pkg::OUTCOME_ACCUMULATED,
      INSERTED = machine_pkg::OUTCOME_INSERTED, MERGED = machine_pkg::OUTCOME_MERGED, EVICTED = machine_pkg::OUTCOME_EVICTED,
      REPLACED = machine_pkg::OUTCOME_REPLACED, DROPPED = machine_pkg::OUTCOME_DROPPED;
  localparam int NEAREST_PAIR = machine_pkg::MERGE_NEAREST_PAIR, FARTHEST_PAIR = machine_pkg::MERGE_FARTHEST_PAIR;
  localparam int REPLACE = machine_pkg::MERGE_REPLACE;

  // The slot of a stack that a one-hot vector selects, or 0 if it is zero.
  function automatic [SLOT_W-1:0] chosen(input [PLACES-1:0] choice, input [STACK_W-1:0] stack);
    integer at;
    begin
      chosen = '0;
      for (at = 0; at < PLACES; at = at + 1) if (choice[at]) chosen = chosen | stack[at*SLOT_W+:SLOT_W];
    end
  endfunction

  // The least of the valid words, one-hot; the first one of equal words.
  function automatic [LAYERS-1:0] least(input [LAYERS-1:0] counts, input [LAYERS*DEPTH_W-1:0] words);
    integer at;
    reg any;
    reg [DEPTH_W-1:0] word;
    begin
      least = '0;
      any = 1'b0;
      word = '0;
      for (at = 0; at < LAYERS; at = at + 1) begin
        if (counts[at] && (!any || words[at*DEPTH_W+:DEPTH_W] < word)) begin
          least = LAYERS'(1) << at;
          any = 1'b1;
          word = words[at*DEPTH_W+:DEPTH_W];
        end
      end
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

  wire [DEPTH_W-1:0] z_threshold = frame[machine_pkg::FRAME_Z_THRESHOLD_LSB+:DEPTH_W];
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

  wire write;
  wire [PIXEL_W-1:0] write_pixel;
  wire [LAYERS-1:0] write_mask;
  wire [SLOTS_W-1:0] write_slots;
  wire [LIVE_W-1:0] write_live;

  wire [SLOTS_W-1:0] slots;
  wire [LAYERS-1:0] slots_opaque;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_slots
    logic [SLOT_W-1:0] memory[0:PIXELS-1];
    logic [SLOT_W-1:0] out;
    logic out_opaque;
    wire [SLOT_W-1:0] word = memory[read_pixel];
    wire word_opaque;
    fragment_opaque is_opaque (
        .shaded(word[SHADED]),
        .weight(word[WEIGHT+:WEIGHT_W]),
        .opacity(word[OPACITY+:OPACITY_W]),
        .coverage_threshold(coverage_threshold),
        .opaque(word_opaque)
    );
    // Not an always_ff: the bench writes the pixels' initial contents at the start of a window, and
    // a variable that an always_ff drives may not be written elsewhere.
    always @(posedge clk) begin
      if (write && write_mask[slot]) memory[write_pixel] <= write_slots[slot*SLOT_W+:SLOT_W];
      if (read) out <= word;
      if (read) out_opaque <= word_opaque;
    end
    assign slots[slot*SLOT_W+:SLOT_W] = out;
    assign slots_opaque[slot] = out_opaque;
  end

  // Number of used slots. A memory cannot be cleared at once, so touched pixels are marked in
  // registers.
  logic [LIVE_W-1:0] lives[0:PIXELS-1];
  logic [LIVE_W-1:0] live_out;
  logic [PIXELS-1:0] touched;
  logic touched_out;
  wire empty_all;
  wire [LIVE_W-1:0] live = touched_out ? live_out : '0;
  always @(posedge clk) begin
    if (write) lives[write_pixel] <= write_live;
    if (read) live_out <= lives[read_pixel];
    if (read) touched_out <= touched[read_pixel];
    if (rst || empty_all) touched <= '0;
    else if (write) touched[write_pixel] <= 1'b1;
  end

  // With a hazard of 1 a pixel is read in the cycle in which it is written.
  wire [SLOTS_W-1:0] held;
  wire [LAYERS-1:0] held_opaque;
  wire [LIVE_W-1:0] held_live;
  if (HAZARD == 1) begin : g_forward
    logic [LAYERS-1:0] mask;
    logic [SLOTS_W-1:0] late_slots;
    logic late;
    logic [LIVE_W-1:0] late_live;
    always_ff @(posedge clk) begin
      if (read) begin
        late <= write && write_pixel == read_pixel;
        mask <= write_mask;
        late_slots <= write_slots;
        late_live <= write_live;
      end
    end
    for (genvar slot = 0; slot < LAYERS; slot++) begin : g_slot
      wire [SLOT_W-1:0] late_slot = late_slots[slot*SLOT_W+:SLOT_W];
      wire late_opaque;
      fragment_opaque is_opaque (
          .shaded(late_slot[SHADED]),
          .weight(late_slot[WEIGHT+:WEIGHT_W]),
          .opacity(late_slot[OPACITY+:OPACITY_W]),
          .coverage_threshold(coverage_threshold),
          .opaque(late_opaque)
      );
      assign held[slot*SLOT_W+:SLOT_W] = late && mask[slot] ? late_slot : slots[slot*SLOT_W+:SLOT_W];
      assign held_opaque[slot] = late && mask[slot] ? late_opaque : slots_opaque[slot];
    end
    assign held_live = late ? late_live : live;
  end else begin : g_stall
    assign held = slots;
    assign held_opaque = slots_opaque;
    assign held_live = live;
  end

  // Contribute: the contribution, and the current contents of its pixel.

  // Before the register: the depth, the depth range in which a slot matches, and whether the
  // contribution alone is opaque.
  wire [DEPTH_W-1:0] s_depth;
  fit #(
      .IN_W(machine_pkg::FRAGMENT_IN_DEPTH_W),
      .PLACES(machine_pkg::RASTER_EXACT_DEPTH_F - machine_pkg::FRAGMENT_DEPTH_F),
      .W(DEPTH_W),
      .S(machine_pkg::FRAGMENT_DEPTH_S),
      .ROUND(machine_pkg::FRAGMENT_DEPTH_ROUND),
      .WRAP(machine_pkg::FRAGMENT_DEPTH_WRAP)
  ) fit_depth (
      .exact($signed(s_data[machine_pkg::FRAGMENT_IN_DEPTH_LSB+:machine_pkg::FRAGMENT_IN_DEPTH_W])),
      .word(s_depth)
  );
  wire [WEIGHT_W-1:0] s_weight;
  wire [OPACITY_W-1:0] s_opacity;
  wire s_opaque;
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(machine_pkg::FRAGMENT_WEIGHT_SUM_F),
      .S(machine_pkg::FRAGMENT_WEIGHT_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_WEIGHT_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_WEIGHT_SUM_WRAP)
  ) weight_alone (
      .sum({WEIGHT_W{1'b0}}),
      .weight(s_data[machine_pkg::FRAGMENT_IN_WEIGHT_LSB+:GAUSS_W]),
      .attribute(1'b1),
      .next(s_weight)
  );
  fragment_sum #(
      .ATTRIBUTE_W(ALPHA_W),
      .ATTRIBUTE_F(machine_pkg::SPLAT_OPACITY_F),
      .ATTRIBUTE_S(machine_pkg::SPLAT_OPACITY_S),
      .W(OPACITY_W),
      .F(machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) opacity_alone (
      .sum({OPACITY_W{1'b0}}),
      .weight(s_data[machine_pkg::FRAGMENT_IN_WEIGHT_LSB+:GAUSS_W]),
      .attribute(s_data[machine_pkg::FRAGMENT_IN_OPACITY_LSB+:ALPHA_W]),
      .next(s_opacity)
  );
  fragment_opaque is_opaque_alone (
      .shaded(1'b0),
      .weight(s_weight),
      .opacity(s_opacity),
      .coverage_threshold(coverage_threshold),
      .opaque(s_opaque)
  );

  logic taken;
  // The depth is stored in the comparators' word.
  // verilator lint_off UNUSEDSIGNAL
  logic [machine_pkg::FRAGMENT_IN_W-1:0] contribution;
  // verilator lint_on UNUSEDSIGNAL
  logic [PIXEL_W-1:0] pixel;
  logic [DEPTH_W-1:0] depth;
  logic signed [DEPTH_W+1:0] nearest;
  logic [DEPTH_W:0] farthest;
  logic opaque_alone;
  wire leave;
  always_ff @(posedge clk) begin
    taken <= !rst && (take || taken && !leave);
    if (take) begin
      contribution <= s_data;
      pixel <= read_pixel;
      depth <= s_depth;
      nearest <= $signed({2'b00, s_depth}) - $signed({2'b00, z_threshold});
      farthest <= {1'b0, s_depth} + {1'b0, z_threshold};
      opaque_alone <= s_opaque;
    end
  end

  wire [X_W-1:0] x = contribution[machine_pkg::FRAGMENT_IN_X_LSB+:X_W];
  wire [Y_W-1:0] y = contribution[machine_pkg::FRAGMENT_IN_Y_LSB+:Y_W];
  wire [GAUSS_W-1:0] weight = contribution[machine_pkg::FRAGMENT_IN_WEIGHT_LSB+:GAUSS_W];
  wire [ALPHA_W-1:0] opacity = contribution[machine_pkg::FRAGMENT_IN_OPACITY_LSB+:ALPHA_W];
  wire [3*RGB_W-1:0] colour = contribution[machine_pkg::FRAGMENT_IN_BLUE_LSB+:3*RGB_W];
  wire [3*N_W-1:0] normal = contribution[machine_pkg::FRAGMENT_IN_NORMAL_Z_LSB+:3*N_W];
  wire [MATERIAL_W-1:0] material = contribution[machine_pkg::FRAGMENT_IN_MATERIAL_LSB+:MATERIAL_W];

  // Match: the first of the nearest.
  wire [LAYERS-1:0] there;
  wire [LAYERS-1:0] near;
  wire [LAYERS*DEPTH_W-1:0] distances;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_match
    wire [DEPTH_W-1:0] its_depth = held[slot*SLOT_W+DEPTH+:DEPTH_W];
    wire [DEPTH_W-1:0] distance = its_depth > depth ? its_depth - depth : depth - its_depth;
    assign distances[slot*DEPTH_W+:DEPTH_W] = distance;
    assign there[slot] = held_live > LIVE_W'(slot);
    wire is_near = $signed({2'b00, its_depth}) > nearest && {1'b0, its_depth} < farthest;
    assign near[slot] = there[slot] && !held[slot*SLOT_W+SHADED] && is_near;
  end
  wire [LAYERS-1:0] found = least(near, distances);
  wire matched = near != '0;
  wire full = there[LAYERS-1];

  // Accumulate: the sums of the matching fragment, or of a new one.
  wire [SHADED-1:0] was = SHADED'(chosen({1'b0, found}, {SLOT_W'(0), held}));
  wire [SLOT_W-1:0] becomes;
  fragment_sum #(
      .ATTRIBUTE_W(1),
      .W(WEIGHT_W),
      .F(machine_pkg::FRAGMENT_WEIGHT_SUM_F),
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
      .ATTRIBUTE_F(machine_pkg::SPLAT_OPACITY_F),
      .ATTRIBUTE_S(machine_pkg::SPLAT_OPACITY_S),
      .W(OPACITY_W),
      .F(machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) opacity_sum (
      .sum(was[OPACITY+:OPACITY_W]),
      .weight(weight),
      .attribute(opacity),
      .next(becomes[OPACITY+:OPACITY_W])
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
        .sum(was[NORMALS+part*NORMAL_W+:NORMAL_W]),
        .weight(weight),
        .attribute(normal[part*N_W+:N_W]),
        .next(becomes[NORMALS+part*NORMAL_W+:NORMAL_W])
    );
  end
  wire [DEPTH_W-1:0] depth_was = was[DEPTH+:DEPTH_W];
  wire keep_depth = matched && (machine_pkg::FRAGMENT_NEAREST_DEPTH == 0 || depth_was < depth);
  assign becomes[DEPTH+:DEPTH_W] = keep_depth ? depth_was : depth;
  assign becomes[MATERIAL+:MATERIAL_W] = matched ? was[MATERIAL+:MATERIAL_W] : material;
  assign becomes[SHADED] = 1'b0;

  // Overflow: all fragments in depth order. Stable: the new one, the last, comes after its equals.
  // It has no match in this case, so it is a separate fragment.
  wire [PLACES-1:0] stacked = {taken, there};
  wire [STACK_W-1:0] unsorted = {becomes, held};
  wire [LAYERS*DEPTH_W-1:0] held_depths;
  wire [PLACES*DEPTH_W-1:0] depths = {depth, held_depths};
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_depth
    assign held_depths[slot*DEPTH_W+:DEPTH_W] = held[slot*SLOT_W+DEPTH+:DEPTH_W];
  end
  wire [PLACES-1:0] opaque = {opaque_alone, held_opaque};
  wire [PLACES-1:0] deepest;
  // One-hot for each place: the fragment in it; and for each fragment: its place.
  wire [PLACES*PLACES-1:0] comes;
  wire [PLACES*PLACES-1:0] goes;
  for (genvar one = 0; one < PLACES; one++) begin : g_rank
    wire [DEPTH_W-1:0] its_depth = depths[one*DEPTH_W+:DEPTH_W];
    wire [PLACES-1:0] in_front;
    for (genvar other = 0; other < PLACES; other++) begin : g_in_front
      wire [DEPTH_W-1:0] other_depth = depths[other*DEPTH_W+:DEPTH_W];
      assign in_front[other] = stacked[other] && (other_depth < its_depth || other_depth == its_depth && other < one);
    end
    wire [PLACE_W-1:0] rank = count(in_front);
    for (genvar place = 0; place < PLACES; place++) begin : g_place
      assign goes[one*PLACES+place] = stacked[one] && rank == PLACE_W'(place);
      assign comes[place*PLACES+one] = goes[one*PLACES+place];
    end
    // All others are present, and in front. A named constant has the full width: Yosys makes 32
    // bits of PLACES'(1) << one.
    localparam [PLACES-1:0] ITSELF = PLACES'(1) << one;
    assign deepest[one] = &(in_front | ITSELF);
  end
  wire [STACK_W-1:0] sorted;
  for (genvar place = 0; place < PLACES; place++) begin : g_sorted
    assign sorted[place*SLOT_W+:SLOT_W] = chosen(comes[place*PLACES+:PLACES], unsorted);
  end
  wire fresh_first = goes[LAYERS*PLACES];
  wire hides = (opaque & ~deepest) != '0;

  // The pair to merge, given by the nearer one of the two: the deepest pair, or the first of the
  // closest ones.
  wire [LAYERS-1:0] pair;
  if (machine_pkg::FRAGMENT_MERGE == NEAREST_PAIR) begin : g_nearest_pair
    wire [LAYERS*DEPTH_W-1:0] apart;
    for (genvar place = 0; place < LAYERS; place++) begin : g_apart
      assign apart[place*DEPTH_W+:DEPTH_W] = sorted[(place+1)*SLOT_W+DEPTH+:DEPTH_W] - sorted[place*SLOT_W+DEPTH+:DEPTH_W];
    end
    assign pair = least({LAYERS{1'b1}}, apart);
  end else if (machine_pkg::FRAGMENT_MERGE == FARTHEST_PAIR || machine_pkg::FRAGMENT_MERGE == REPLACE) begin : g_farthest_pair
    // If the nearer fragment replaces the other, there is no pair to merge, and this result is not
    // used.
    assign pair = LAYERS'(1) << (LAYERS - 1);
  end else begin : g_unknown_rule
`ifdef __ICARUS__
    // Icarus has no $error at elaboration, but refuses a module that does not exist.
    fragment_has_no_such_rule_of_merging unknown_rule ();
`else
    $error("fragment has no such rule of merging: FRAGMENT_MERGE is nearest pair, farthest pair or replace");
`endif
    assign pair = '0;
  end

  localparam int OUTCOME_W = machine_pkg::FRAGMENT_OUT_OUTCOME_W;
  wire [OUTCOME_W-1:0] overflow = machine_pkg::FRAGMENT_MERGE == REPLACE ? (fresh_first ? REPLACED : DROPPED)
      : machine_pkg::FRAGMENT_EVICT_HIDDEN != 0 && hides ? EVICTED : MERGED;
  wire [OUTCOME_W-1:0] outcome = matched ? ACCUMULATED : !full ? INSERTED : overflow;
  wire overflows = outcome == MERGED || outcome == EVICTED;
  wire [SLOT_NUMBER_W-1:0] decided_slot = matched ? number({1'b0, found}) : !full ? SLOT_NUMBER_W'(held_live)
      : outcome == EVICTED ? SLOT_NUMBER_W'(deepest[LAYERS]) : outcome == MERGED ? number({1'b0, pair}) : '0;

  // Merge: both fragments are shaded, the front one first, once each.
  wire merging = taken && outcome == MERGED;
  wire [SLOT_W-1:0] over = chosen({1'b0, pair}, sorted);
  wire [SLOT_W-1:0] under = chosen({pair, 1'b0}, sorted);
  wire ask_over = !over[SHADED];
  wire ask_under = !under[SHADED];
  logic asked_over, asked_under, here_over;
  logic [machine_pkg::FRAGMENT_ANSWER_W-1:0] light_over;
  wire asks_over = ask_over && !asked_over;
  wire asks_under = ask_under && !asked_under;
  assign q_valid = merging && (asks_over || asks_under);
  // The uppermost bits are unused if a request has no pixel.
  assign q_data = machine_pkg::FRAGMENT_REQUEST_W'({x, y, asks_over ? over[ASKED_W-1:0] : under[ASKED_W-1:0]});

  // A response is the front fragment's until that has arrived.
  wire awaits_over = ask_over && !here_over;
  wire complete = merging && (awaits_over ? a_valid && !ask_under : a_valid || !ask_under);
  assign a_ready = merging && (awaits_over && ask_under || leave && (awaits_over || ask_under));
  always_ff @(posedge clk) begin
    if (rst || leave) begin
      asked_over <= 1'b0;
      asked_under <= 1'b0;
      here_over <= 1'b0;
    end else if (merging) begin
      if (q_valid && q_ready) begin
        asked_over <= 1'b1;
        asked_under <= !asks_over;
      end
      if (a_valid && a_ready) here_over <= 1'b1;
    end
    if (a_valid && a_ready) light_over <= a_data;
  end
  wire [4*LIGHT_W-1:0] lit_over, lit_under;
  fragment_lit lit_front (.slot(over[ASKED_W-1:0]), .shaded(!ask_over), .light(here_over ? light_over : a_data), .lit(lit_over));
  fragment_lit lit_back (.slot(under[ASKED_W-1:0]), .shaded(!ask_under), .light(a_data), .lit(lit_under));

  // Front over back, at the front's depth.
  wire [SLOT_W-1:0] merged;
  for (genvar channel = 0; channel < 3; channel++) begin : g_blend
    fragment_over #(
        .W(COLOUR_W),
        .F(machine_pkg::FRAGMENT_COLOUR_SUM_F),
        .S(machine_pkg::FRAGMENT_COLOUR_SUM_S),
        .ROUND(machine_pkg::FRAGMENT_COLOUR_SUM_ROUND),
        .WRAP(machine_pkg::FRAGMENT_COLOUR_SUM_WRAP)
    ) blend_colour (
        .front(lit_over[(channel+1)*LIGHT_W+:LIGHT_W]),
        .back(lit_under[(channel+1)*LIGHT_W+:LIGHT_W]),
        .opacity(lit_over[LIGHT_W-1:0]),
        .word(merged[COLOURS+channel*COLOUR_W+:COLOUR_W])
    );
  end
  fragment_over #(
      .W(OPACITY_W),
      .F(machine_pkg::FRAGMENT_OPACITY_SUM_F),
      .S(machine_pkg::FRAGMENT_OPACITY_SUM_S),
      .ROUND(machine_pkg::FRAGMENT_OPACITY_SUM_ROUND),
      .WRAP(machine_pkg::FRAGMENT_OPACITY_SUM_WRAP)
  ) blend_opacity (
      .front(lit_over[LIGHT_W-1:0]),
      .back(lit_under[LIGHT_W-1:0]),
      .opacity(lit_over[LIGHT_W-1:0]),
      .word(merged[OPACITY+:OPACITY_W])
  );
  assign merged[WEIGHT+:WEIGHT_W] = '0;
  assign merged[NORMALS+:3*NORMAL_W] = '0;
  assign merged[MATERIAL+:MATERIAL_W] = over[MATERIAL+:MATERIAL_W];
  assign merged[DEPTH+:DEPTH_W] = over[DEPTH+:DEPTH_W];
  assign merged[SHADED] = 1'b1;

  // The written data, and when it is written.
  wire [LAYERS-1:0] decided_mask;
  wire [SLOTS_W-1:0] decided_slots;
  for (genvar slot = 0; slot < LAYERS; slot++) begin : g_decided
    // Slots behind a merged pair move up by one.
    wire behind_pair = outcome == MERGED && (pair & LAYERS'((1 << slot) - 1)) != '0;
    wire [SLOT_W-1:0] stays = behind_pair ? sorted[(slot+1)*SLOT_W+:SLOT_W] : sorted[slot*SLOT_W+:SLOT_W];
    assign decided_mask[slot] = overflows || outcome != DROPPED && decided_slot == SLOT_NUMBER_W'(slot);
    assign decided_slots[slot*SLOT_W+:SLOT_W] = !overflows ? becomes : outcome == MERGED && pair[slot] ? merged : stays;
  end
  wire [LIVE_W-1:0] decided_live = outcome == INSERTED ? held_live + LIVE_W'(1) : held_live;
  wire under_way;
  fragment_late #(
      .W(PIXEL_W + LAYERS + SLOTS_W + LIVE_W),
      .HAZARD(HAZARD)
  ) late (
      .clk(clk),
      .rst(rst),
      .decided(leave),
      .decision({pixel, decided_mask, decided_slots, decided_live}),
      .write(write),
      .written({write_pixel, write_mask, write_slots, write_live}),
      .under_way(under_way)
  );

  // A merge occupies the unit until its last cycle; any other contribution has left when the next
  // one comes.
  wire room;
  wire free = MERGE_CYCLES == 0 ? leave : taken && !merging && room;

  // Pixels taken in the last HAZARD - 1 cycles; a merge counts as taken in its last cycle.
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

  // Further cycles of a merge; it blends in one of them.
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
  wire decided = taken && (!merging || complete);
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
      .s_data({x, y, outcome, decided_slot}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  assign leave = decided && room;
  logic done;
  assign s_ready = !walking && !done && !rests && !(s_valid && waits) && (!taken || free);

  // Walk: the contents of all pixels, row by row, in depth order.

  wire start = drain && !s_valid && !taken && !under_way && !walking && !done;
  logic [X_W-1:0] at_x;
  logic [Y_W-1:0] at_y;
  logic here;
  logic [LIVE_W-1:0] place;
  assign h_valid = walking && here;
  assign h_empty = held_live == '0;
  assign h_last = h_empty || place + LIVE_W'(1) == held_live;
  wire next = walking && (!here || h_ready && h_last);
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
    if (next) place <= '0;
    else if (h_ready) place <= place + LIVE_W'(1);
  end
  wire [PLACES-1:0] shown_place = PLACES'(1) << place;
  wire [SLOT_W-1:0] shown = chosen(shown_place, sorted);
  wire [SLOT_NUMBER_W-1:0] shown_slot = number(PLACES'(comes >> (32'(place) * PLACES)));
  wire [4*LIGHT_W-1:0] lit_shown;
  fragment_lit lit_held (.slot(shown[ASKED_W-1:0]), .shaded(1'b1), .light({machine_pkg::FRAGMENT_ANSWER_W{1'b0}}), .lit(lit_shown));
  assign h_data = {
    at_x,
    at_y,
    shown_slot,
    shown[SHADED],
    shown[DEPTH+:DEPTH_W],
    shown[MATERIAL+:MATERIAL_W],
    shown[SHADED] ? (ASKED_W - MATERIAL_W)'(0) : shown[ASKED_W-1:MATERIAL_W],
    shown[SHADED] ? lit_shown : (4 * LIGHT_W)'(0)
  };
endmodule

`default_nettype wire
