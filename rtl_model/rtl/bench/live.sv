// Live: drives one RTL implementation with random records and compares its outputs with the live
// model, over DPI-C, without files. For Verilator.
//
//   random ->[ offer, sometimes not ]-> s ->( DUT )-> m ->[ take, sometimes not ]-> scoreboard
//                                      q -> shade, the model's -> a      h -> scoreboard
//
// Compile with machine_pkg.sv and splatsim_dpi.sv of a trace, and link with the C library. Macros are those of bench.sv, and
//   UNIT             the unit's name, a string
//   HAS_SHADE        it has the ports q and a
//   HAS_HELD         it has the port h
// Arguments
//   +records=N       approximate number of records to compare
//   +stall=N         percent of cycles in which no new record is offered; in which none is taken
//   +seed=N          seed of stalls
//   +source=N        seed of random records
//   +patience=N      cycles without a transfer after which the bench gives up
// The parameters name the machine and the scene.

`timescale 1ns / 1ps
`default_nettype none
// A program, not hardware: a counter is read in the cycle in which it changes.
// verilator lint_off BLKSEQ
module live #(
  parameter string MACHINE = "machine.json",
  parameter string SCENE = "scene.json"
);
`ifdef HAS_SHADE
  localparam int Q_W = machine_pkg::FRAGMENT_REQUEST_W;
`else
  localparam int Q_W = 1;
`endif
`ifdef HAS_HELD
  localparam int H_W = machine_pkg::FRAGMENT_HELD_W;
`else
  localparam int H_W = 1;
`endif

  reg clk = 1'b0;
  reg rst = 1'b1;
  always #5 clk = !clk;

  reg s_valid = 1'b0;
  wire s_ready;
  reg [`IN_W-1:0] s_data = '0;
  wire m_valid;
  reg m_ready = 1'b0;
  wire [`OUT_W-1:0] m_data;
  reg drain = 1'b0;
  wire drained;
  wire q_valid;
  reg q_ready = 1'b0;
  wire [Q_W-1:0] q_data;
  wire h_valid;
  wire h_empty;
  reg h_ready = 1'b0;
  wire [H_W-1:0] h_data;

  // The model generates records, and provides the constants.
  chandle source;
  longint unsigned source_seed;
`ifdef HAS_FRAME
  reg [machine_pkg::FRAME_W-1:0] frame = '0;
`endif
`ifdef HAS_LIGHTING
  reg [machine_pkg::LIGHTS_PORT_W-1:0] lights = '0;
  reg [machine_pkg::MATERIALS_PORT_W-1:0] materials = '0;
  reg [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections = '0;
`endif
  initial begin
    if ($value$plusargs("source=%d", source_seed) == 0) source_seed = 1;
    source = splatsim_dpi::open(`UNIT, MACHINE, SCENE, 0, 0, source_seed);
`ifdef HAS_FRAME
    frame = machine_pkg::FRAME_W'(splatsim_dpi::constant(source, "frame", 0));
`endif
`ifdef HAS_LIGHTING
    for (int i = 0; i < machine_pkg::LIGHTS; i++)
      lights |= machine_pkg::LIGHTS_PORT_W'(splatsim_dpi::constant(source, "light", i)) << (i * machine_pkg::LIGHT_W);
    for (int i = 0; i < machine_pkg::MATERIALS; i++)
      materials |= machine_pkg::MATERIALS_PORT_W'(splatsim_dpi::constant(source, "material", i)) << (i * machine_pkg::MATERIAL_W);
    for (int i = 0; i < machine_pkg::MATERIALS * machine_pkg::LIGHTS; i++)
      reflections |= machine_pkg::REFLECTIONS_PORT_W'(splatsim_dpi::constant(source, "reflection", i)) << (i * machine_pkg::REFLECTION_W);
`endif
  end

`ifdef HAS_SHADE
  reg a_valid = 1'b0;
  wire a_ready;
  reg [machine_pkg::FRAGMENT_ANSWER_W-1:0] a_data = '0;
  chandle shade;
  initial shade = splatsim_dpi::open("shade", MACHINE, SCENE, 0, 0, 1);
`else
  assign q_valid = 1'b0;
  assign q_data = '0;
`endif
`ifndef HAS_HELD
  assign h_valid = 1'b0;
  assign h_empty = 1'b1;
  assign h_data = '0;
`endif
`ifndef HAS_DRAIN
  assign drained = 1'b1;
`endif

  `DUT
`ifdef DUT_PARAMETERS
  #(`DUT_PARAMETERS)
`endif
  dut (
    .clk(clk),
    .rst(rst),
`ifdef HAS_FRAME
    .frame(frame),
`endif
`ifdef HAS_LIGHTING
    .lights(lights),
    .materials(materials),
    .reflections(reflections),
`endif
`ifdef HAS_LEAST
    .least({machine_pkg::GAUSS_WEIGHT_W{1'b0}}),
`endif
`ifdef HAS_CORNER
    .corner({(machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W) {1'b0}}),
`endif
`ifdef HAS_DRAIN
    .drain(drain),
    .drained(drained),
`endif
`ifdef HAS_SHADE
    .q_valid(q_valid),
    .q_ready(q_ready),
    .q_data(q_data),
    .a_valid(a_valid),
    .a_ready(a_ready),
    .a_data(a_data),
    // verilator lint_off PINCONNECTEMPTY
    .h_last(),
    // verilator lint_on PINCONNECTEMPTY
`endif
`ifdef HAS_HELD
    .h_valid(h_valid),
    .h_ready(h_ready),
    .h_empty(h_empty),
    .h_data(h_data),
`endif
    .s_valid(s_valid),
    .s_ready(s_ready),
    .s_data(s_data),
    .m_valid(m_valid),
    .m_ready(m_ready),
    .m_data(m_data)
  );

  longint compared;
  longint different;
  longint waiting;
  splatsim_scoreboard #(
    .UNIT(`UNIT),
    .MACHINE(MACHINE),
    .SCENE(SCENE),
    .S_W(`IN_W),
    .M_W(`OUT_W),
    .Q_W(Q_W),
    .H_W(H_W)
  ) scoreboard (
    .clk(clk),
    .rst(rst),
    .s_valid(s_valid),
    .s_ready(s_ready),
    .s_data(s_data),
    .m_valid(m_valid),
    .m_ready(m_ready),
    .m_data(m_data),
    .q_valid(q_valid),
    .q_ready(q_ready),
    .q_data(q_data),
`ifdef HAS_DRAIN
    .drain(drain),
`else
    // Only fragment ends frames. The bench may stop inside a pixel of resolve.
    .drain(1'b0),
`endif
    .h_valid(h_valid && !h_empty),
    .h_ready(h_ready),
    .h_data(h_data),
    .compared(compared),
    .different(different),
    .waiting(waiting)
  );

  longint records;
  integer stall;
  integer patience;
  reg [31:0] chance;
  initial begin
    if ($value$plusargs("records=%d", records) == 0) records = 1000;
    if ($value$plusargs("stall=%d", stall) == 0) stall = 0;
    if ($value$plusargs("patience=%d", patience) == 0) patience = 100000;
    if ($value$plusargs("seed=%d", chance) == 0) chance = 1;
    chance = chance == 0 ? 32'h9e3779b9 : chance;
  end

  function automatic [31:0] xorshift(input [31:0] state);
    reg [31:0] x;
    begin
      x = state ^ (state << 13);
      x = x ^ (x >> 17);
      xorshift = x ^ (x << 5);
    end
  endfunction

  longint taken = 0;
  longint idle = 0;
  longint complete_for = 0;
  integer edges = 0;
  always @(posedge clk) begin
    edges = edges < 3 ? edges + 1 : edges;
    if (edges == 3) rst <= 1'b0;
    if (!rst) begin
      chance = xorshift(chance);
      if (s_valid && s_ready) taken = taken + 1;
      // An offer stays until it is taken.
      if (!s_valid || s_ready) begin
        s_valid <= 1'b0;
        if (compared >= records) drain <= 1'b1;
        else if (chance % 100 >= stall) begin
          s_valid <= 1'b1;
          s_data <= `IN_W'(splatsim_dpi::random(source));
        end
      end
      m_ready <= (chance >> 7) % 100 >= stall;
      q_ready <= 1'b0;
      h_ready <= (chance >> 9) % 100 >= stall;
`ifdef HAS_SHADE
      // One request at a time: the response comes in the next cycle.
      q_ready <= !a_valid && !(q_valid && q_ready) && (chance >> 11) % 100 >= stall;
      if (a_valid && a_ready) a_valid <= 1'b0;
      if (q_valid && q_ready) begin
        bit [machine_pkg::SHADE_OUT_W-1:0] light;
        longint lit;
        bit there;
        lit = splatsim_dpi::shade(shade, q_data);
        there = splatsim_dpi::shade_next(shade, light);
        if (lit != 1 || !there) $fatal(1, "shade says nothing");
        a_valid <= 1'b1;
        a_data <= light;
      end
`endif
      idle = s_valid && s_ready || m_valid && m_ready || h_valid && h_ready || q_valid && q_ready ? 0 : idle + 1;
      complete_for = drain && !s_valid && drained && waiting == 0 ? complete_for + 1 : 0;
      if (different != 0 || complete_for > 200 || idle >= longint'(patience)) begin
        if (different != 0) $display("live: FAILED: record %0d is different", compared);
        else if (complete_for <= 200) $display("live: FAILED: %0d records of the model never came", waiting);
        else $display("live: done in=%0d compared=%0d", taken, compared);
        $finish(0);
      end
    end
  end
endmodule
// verilator lint_on BLKSEQ

`default_nettype wire
