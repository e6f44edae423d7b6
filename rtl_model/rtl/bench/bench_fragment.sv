// Bench_fragment: fragment, or windows, with a recorded shade behind it, as a unit with one input
// and one output for bench.sv.
//
//   s ->( fragment )-> m
//        q -> +requests=FILE   +answers=FILE -> a      h -> +held=FILE
//
// Compile with bench.sv, bench_start.sv, -DDUT=bench_fragment -DHAS_FRAME -DHAS_DRAIN -DIN_W=machine_pkg::FRAGMENT_IN_W
// -DOUT_W=machine_pkg::FRAGMENT_OUT_W and '-DDUT_PARAMETERS=.WIDTH(64),.HEIGHT(64)'; for windows -DHAS_WINDOWS too, without bench_start.sv.
// Arguments, in addition to those of bench.sv and bench_start.sv
//   +answers=FILE    responses of shade, one line of hex per request
//   +requests=FILE   file for the requests to shade
//   +held=FILE       file for the final contents of the pixels
//   +stall_shade=N   percent of cycles in which shade takes no request, and in which it gives no response
//   +stall_held=N    percent of cycles in which no final content is taken
`timescale 1ns / 1ps
`default_nettype none

// A program, not hardware: a counter is read in the cycle in which it changes.
// verilator lint_off BLKSEQ
module bench_fragment #(
`ifdef HAS_WINDOWS
  parameter ROMS = "rom/",  // folder of the tables, with its slash
`endif
  parameter int WIDTH = 16, // columns of pixels
  parameter int HEIGHT = 16 // rows of pixels
) (
  input wire clk,                                       // as fragment's
  input wire rst,                                       // as fragment's
  input wire [machine_pkg::FRAME_W-1:0] frame,          // as fragment's
  input wire s_valid,                                   // as fragment's
  output wire s_ready,                                  // as fragment's
  input wire [machine_pkg::FRAGMENT_IN_W-1:0] s_data,   // as fragment's
  output wire m_valid,                                  // as fragment's
  input wire m_ready,                                   // as fragment's
  output wire [machine_pkg::FRAGMENT_OUT_W-1:0] m_data, // as fragment's
  input wire drain,                                     // as fragment's
  output wire drained                                   // as fragment's
);
  localparam int NAME_CHARS = 512;
  localparam int ANSWER_W = machine_pkg::FRAGMENT_ANSWER_W;
  localparam int REQUEST_W = machine_pkg::FRAGMENT_REQUEST_W;
  localparam int HELD_W = machine_pkg::FRAGMENT_HELD_W;

`ifdef HAS_WINDOWS
  // No window of splats begins with contents of pixels here.
  wire loaded = 1'b1;
`else
  wire loaded, loads;
  wire [machine_pkg::FRAGMENT_START_W-1:0] start;
  wire [31:0] start_pixel;
  bench_start #(.WIDTH(WIDTH)) starter (
    .clk(clk),
    .rst(rst),
    .loaded(loaded),
    .loads(loads),
    .record(start),
    .pixel(start_pixel)
  );
`endif

  wire takes;
  assign s_ready = takes && loaded;
  wire q_valid;
  reg q_ready = 1'b0;
  wire [REQUEST_W-1:0] q_data;
  reg a_valid = 1'b0;
  wire a_ready;
  reg [ANSWER_W-1:0] a_data = '0;
  wire h_valid;
  wire h_empty;
  reg h_ready = 1'b0;
  wire [HELD_W-1:0] h_data;

`ifdef HAS_WINDOWS
  windows #(
    .ROMS(ROMS),
`else
  fragment #(
`endif
    .WIDTH(WIDTH),
    .HEIGHT(HEIGHT)
  ) unit (
    .clk(clk),
    .rst(rst),
    .frame(frame),
    .s_valid(s_valid && loaded),
    .s_ready(takes),
    .s_data(s_data),
    .m_valid(m_valid),
    .m_ready(m_ready),
    .m_data(m_data),
    .q_valid(q_valid),
    .q_ready(q_ready),
    .q_data(q_data),
    .a_valid(a_valid),
    .a_ready(a_ready),
    .a_data(a_data),
    .drain(drain && loaded),
    .drained(drained),
    .h_valid(h_valid),
    .h_ready(h_ready),
    // verilator lint_off PINCONNECTEMPTY
    .h_last(),
    // verilator lint_on PINCONNECTEMPTY
    .h_empty(h_empty),
    .h_data(h_data)
  );

`ifndef HAS_WINDOWS
`ifndef NETLIST
  // The initial contents of pixels are written directly into their memory, which has another name
  // in a netlist.
  localparam int MATERIAL_W = machine_pkg::FRAGMENT_START_MATERIAL_W;
  localparam int MATERIAL = machine_pkg::FRAGMENT_START_MATERIAL_LSB;
  localparam int SLOT_W = machine_pkg::FRAGMENT_START_SLOT_LSB;
  wire [31:0] start_slot = 32'(start[SLOT_W+:machine_pkg::FRAGMENT_START_SLOT_W]);
  // The material is the last field of a slot.
  wire [SLOT_W-1:0] start_word = {start[SLOT_W-1:MATERIAL+MATERIAL_W], start[MATERIAL-1:0], start[MATERIAL+:MATERIAL_W]};
  for (genvar slot = 0; slot < machine_pkg::FRAGMENT_LAYERS; slot++) begin : g_load
    always @(posedge clk) if (loads && start_slot == slot) unit.g_slots[slot].memory[start_pixel] <= start_word;
  end
  // The slots of a pixel are in order.
  always @(posedge clk) begin
    if (loads) begin
      unit.lives[start_pixel] <= ($clog2(machine_pkg::FRAGMENT_LAYERS + 1))'(start_slot + 1);
      unit.touched[start_pixel] <= 1'b1;
    end
  end
`endif
`endif

  reg [8*NAME_CHARS-1:0] name;
  integer answers_file = 0;
  integer requests_file = 0;
  integer held_file = 0;
  integer stall_shade;
  integer stall_held;
  reg [31:0] chance = 32'h2545f491;
  longint cycle = 0;
  longint asked = 0;
  longint told = 0;
  longint violations = 0;
  longint rest = 0;
  // For each request in flight, the cycle of its response: a merge has two.
  longint due[0:3];
  reg q_waits = 1'b0;
  reg h_waits = 1'b0;
  reg [REQUEST_W-1:0] q_waiting = '0;
  reg [HELD_W-1:0] h_waiting = '0;
  reg [ANSWER_W-1:0] answer;
  reg drain_was = 1'b0;
  integer file_error;

  function automatic [31:0] xorshift(input [31:0] state);
    reg [31:0] x;
    begin
      x = state ^ (state << 13);
      x = x ^ (x >> 17);
      xorshift = x ^ (x << 5);
    end
  endfunction

  initial begin
    if ($value$plusargs("stall_shade=%d", stall_shade) == 0) stall_shade = 0;
    if ($value$plusargs("stall_held=%d", stall_held) == 0) stall_held = 0;
    if ($value$plusargs("answers=%s", name) != 0) begin
      answers_file = $fopen(name, "r");
      if (answers_file == 0) begin
        $display("bench: FAILED cannot read %0s", name);
        $finish(0);
      end
    end
    if ($value$plusargs("requests=%s", name) != 0) requests_file = $fopen(name, "w");
    if ($value$plusargs("held=%s", name) != 0) held_file = $fopen(name, "w");
  end

  always @(posedge clk) begin
    chance = xorshift(chance);
    if (!rst) begin
      // Offered records stay until they are taken.
      if (q_waits && (!q_valid || q_data !== q_waiting) || h_waits && (!h_valid || h_data !== h_waiting)) begin
        violations = violations + 1;
        if (violations == 1) $display("bench: FAILED in cycle %0d what was offered and not taken, at q or h, has changed", cycle);
      end
      q_waits = q_valid && !q_ready;
      q_waiting = q_data;
      h_waits = h_valid && !h_ready;
      h_waiting = h_data;
      // There are no unknown bits.
      if ((^{q_valid, a_ready, h_valid} ^ ^{q_valid, a_ready, h_valid}) !== 1'b0 || q_valid && (^q_data ^ ^q_data) !== 1'b0
          || h_valid && !h_empty && (^h_data ^ ^h_data) !== 1'b0) begin
        violations = violations + 1;
        if (violations == 1) $display("bench: FAILED in cycle %0d what is offered at q or h is not known: %h, %h", cycle, q_data, h_data);
      end
      // The next frame has the same requests.
      if (drain_was && !drain && answers_file != 0) file_error = $rewind(answers_file);
      drain_was = drain;

      if (a_valid && a_ready) begin
        told = told + 1;
        a_valid <= 1'b0;
      end
      if (q_valid && q_ready) begin
        if (requests_file != 0) $fwrite(requests_file, "%h\n", q_data);
        due[asked[1:0]] = cycle + longint'(machine_pkg::SHADE_LATENCY);
        asked = asked + 1;
        rest = longint'(machine_pkg::SHADE_INTERVAL);
      end
      if ((!a_valid || a_ready) && told < asked && due[told[1:0]] <= cycle + 1 && (chance >> 8) % 100 >= stall_shade) begin
        if ($fscanf(answers_file, "%h", answer) != 1) begin
          $display("bench: FAILED there is no answer to request %0d", told + 1);
          $finish(0);
        end
        a_valid <= 1'b1;
        a_data <= answer;
      end
      if (h_valid && h_ready && !h_empty && held_file != 0) $fwrite(held_file, "%h\n", h_data);
      cycle = cycle + 1;
      if (rest > 0) rest = rest - 1;
    end
    q_ready <= rest == 0 && (chance >> 7) % 100 >= stall_shade;
    h_ready <= (chance >> 6) % 100 >= stall_held;
  end
endmodule
// verilator lint_on BLKSEQ

`default_nettype wire
