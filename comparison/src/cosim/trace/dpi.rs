//! DPI: writes the live model for SystemVerilog: one function per unit, and modules that compare a
//! device's streams with it.

use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream};
use rtl_model::records::unit;
use std::fmt::Write;

/// The package `splatsim_dpi` and its modules. Functions are those of the C library; `size_t` must
/// have 64 bits.
pub fn dpi(machine: &Elaborated, kind: Kind) -> String {
    let streams = ports::streams(machine, kind);
    let widest = streams
        .iter()
        .chain(&ports::constants(machine, kind))
        .map(Stream::width)
        .max()
        .unwrap_or(1);
    let mut text = format!(
        "// Live model of the units, over DPI-C, written by splatsim {}: link the simulation with the C library (bindings/c).\n\
         // Output records of a unit are queued until they are read (…_next) or compared.\n\
         `timescale 1ns / 1ps\n`default_nettype none\n/* verilator lint_off DECLFILENAME */\n/* verilator lint_off UNUSEDPARAM */\n\
         package splatsim_dpi;\n  \
           // 32-bit words of the widest record.\n  localparam int WORDS = {};\n",
        env!("CARGO_PKG_VERSION"),
        widest.div_ceil(32)
    );
    text.push_str(PACKAGE);
    for name in unit::ALL {
        let has = |end: &str| {
            streams
                .iter()
                .any(|stream| stream.name == format!("{name}.{end}"))
        };
        if has("in") && has("out") {
            let upper = name.to_uppercase();
            let _ = write!(
                text,
                "\n  // Passes a record of {name}.in to {name}; returns the number of pending records of {name}.out.\n  \
                   function automatic longint {name}(chandle model, bit [machine_pkg::{upper}_IN_W-1:0] record);\n    \
                     return step(model, record_t'(record));\n  endfunction\n\n  \
                   // The oldest pending record of {name}.out; returns 0 if there is none.\n  \
                   function automatic bit {name}_next(chandle model, output bit [machine_pkg::{upper}_OUT_W-1:0] record);\n    \
                     record_t next;\n    bit there;\n    there = take(model, OUT, next);\n    record = ($bits(record))'(next);\n    return there;\n  \
                   endfunction\n",
            );
        }
    }
    text.push_str(MODULES);
    text
}

const PACKAGE: &str = r#"  typedef bit [32*WORDS-1:0] record_t;

  // Ports of a unit.
  localparam int IN = 0;
  localparam int OUT = 1;
  localparam int REQUEST = 2;
  localparam int ANSWER = 3;
  localparam int HELD = 4;

  import "DPI-C" function string splatsim_last_error();
  import "DPI-C" function chandle splatsim_machine_open(input string name_or_path);
  import "DPI-C" function void splatsim_machine_free(input chandle machine);
  import "DPI-C" function chandle splatsim_scene_open(input string name_or_path, input int unsigned width, input int unsigned height);
  import "DPI-C" function void splatsim_scene_free(input chandle scene);
  import "DPI-C" function chandle splatsim_unit_new(input chandle machine, input chandle scene, input string name,
    input longint unsigned seed);
  import "DPI-C" function void splatsim_unit_free(input chandle model);
  import "DPI-C" function longint splatsim_unit_step_bits(input chandle model, input record_t words, input longint unsigned count);
  import "DPI-C" function longint splatsim_unit_end(input chandle model);
  import "DPI-C" function longint splatsim_unit_waiting(input chandle model, input int side);
  import "DPI-C" function int splatsim_unit_next_bits(input chandle model, input int side, output record_t words,
    input longint unsigned count);
  import "DPI-C" function int splatsim_unit_compare_bits(input chandle model, input int side, input record_t words,
    input longint unsigned count);
  import "DPI-C" function int splatsim_unit_random_bits(input chandle model, output record_t words, input longint unsigned count);
  import "DPI-C" function int splatsim_unit_constant_bits(input chandle model, input string name, input longint unsigned number,
    output record_t words, input longint unsigned count);

  // Opens a unit by its name. A machine and a scene are names or files; width and height 0 mean the size of the scene.
  function automatic chandle open(string name, string machine, string scene, int unsigned width, int unsigned height,
      longint unsigned seed);
    chandle of_machine, of_scene, model;
    of_machine = splatsim_machine_open(machine);
    if (of_machine == null) $fatal(1, "%s", splatsim_last_error());
    of_scene = splatsim_scene_open(scene, width, height);
    if (of_scene == null) $fatal(1, "%s", splatsim_last_error());
    model = splatsim_unit_new(of_machine, of_scene, name, seed);
    if (model == null) $fatal(1, "%s", splatsim_last_error());
    splatsim_scene_free(of_scene);
    splatsim_machine_free(of_machine);
    return model;
  endfunction

  // Passes a record to a unit; returns the number of pending records at OUT.
  function automatic longint step(chandle model, record_t record);
    longint waiting;
    waiting = splatsim_unit_step_bits(model, record, 64'(WORDS));
    if (waiting < 0) $fatal(1, "%s", splatsim_last_error());
    return waiting;
  endfunction

  // Removes the oldest pending record; returns 0 if there is none.
  function automatic bit take(chandle model, int side, output record_t record);
    int there;
    there = splatsim_unit_next_bits(model, side, record, 64'(WORDS));
    if (there < 0) $fatal(1, "%s", splatsim_last_error());
    if (there == 0) record = '0;
    return there == 1;
  endfunction

  // Whether a device's record equals the model's; prints a message if it does not.
  function automatic bit is_equal(chandle model, int side, record_t record);
    int differs;
    differs = splatsim_unit_compare_bits(model, side, record, 64'(WORDS));
    if (differs != 0) $display("splatsim: at %0d ns: %s", $time, splatsim_last_error());
    return differs == 0;
  endfunction

  // A valid input record: corners and thresholds first, then random ones, without end.
  function automatic record_t random(chandle model);
    record_t record;
    if (splatsim_unit_random_bits(model, record, 64'(WORDS)) != 0) $fatal(1, "%s", splatsim_last_error());
    return record;
  endfunction

  // A constant of the frame: record `number` of "frame", "light", "material" or "reflection".
  function automatic record_t constant(chandle model, string name, int unsigned number);
    record_t record;
    if (splatsim_unit_constant_bits(model, name, 64'(number), record, 64'(WORDS)) != 1) $fatal(1, "%s: no record %0d", name, number);
    return record;
  endfunction
"#;

const MODULES: &str = r#"endpackage

// Compares a device's streams with the live model of its unit: s is its input, m its output; for fragment, q are its requests to shade, h
// its fragments at the end of a frame. Streams that the unit lacks are left unconnected. X and Z bits count as differences, even in unused fields.
module splatsim_scoreboard #(
  parameter string UNIT = "gauss",           // the unit's name
  parameter string MACHINE = "machine.json", // a name or a file
  parameter string SCENE = "scene.json",     // a name or a file
  parameter int unsigned PICTURE_W = 0,      // columns, or 0 for the scene's own
  parameter int unsigned PICTURE_H = 0,      // rows
  parameter int S_W = 1,                     // bits of the records
  parameter int M_W = 1,
  parameter int Q_W = 1,
  parameter int H_W = 1
) (
  input wire clk,                  // rising edge
  input wire rst,                  // inactive while 1
  input wire s_valid,              // a record is offered
  input wire s_ready,              // and taken
  input wire [S_W-1:0] s_data,     // the record
  input wire m_valid,              // as s
  input wire m_ready,
  input wire [M_W-1:0] m_data,
  input wire q_valid,              // as s
  input wire q_ready,
  input wire [Q_W-1:0] q_data,
  input wire drain,                // 1 ends the frame: no record follows until it is 0 again
  input wire h_valid,              // as s
  input wire h_ready,
  input wire [H_W-1:0] h_data,
  output longint compared,         // number of records compared
  output longint different,        // number that differ from the model's, or have X or Z bits
  output longint waiting           // number of the model's records still pending
);
  chandle model;
  bit has_ended;
  initial begin
    model = splatsim_dpi::open(UNIT, MACHINE, SCENE, PICTURE_W, PICTURE_H, 1);
    {compared, different, waiting} = '0;
    has_ended = 1'b0;
  end
  final splatsim_dpi::splatsim_unit_free(model);

  function automatic void compare(int side, splatsim_dpi::record_t record, bit is_unknown);
    bit is_equal;
    is_equal = splatsim_dpi::is_equal(model, side, record);
    compared = compared + 1;
    if (!is_equal || is_unknown) different = different + 1;
  endfunction

  // Whether a stream has an X or Z bit; prints a message if it does.
  function automatic bit unknown(string stream, string what, bit is_so);
    if (is_so) $display("splatsim: at %0d ns: %s.%s: %s is X or Z in part", $time, UNIT, stream, what);
    return is_so;
  endfunction

  // Answers of shade are not compared: remove the one of this request.
  function automatic void forget_answer();
    splatsim_dpi::record_t answer;
    void'(splatsim_dpi::take(model, splatsim_dpi::ANSWER, answer));
  endfunction

  // Blocking assignments: counters are read in the same cycle.
  // verilator lint_off BLKSEQ
  always @(posedge clk) begin
    if (!rst) begin
      // If one of valid and ready is 0 there is no transfer, even if the other is X.
      if (unknown("s", "a handshake", $isunknown(s_valid && s_ready))) different = different + 1;
      if (unknown("m", "a handshake", $isunknown(m_valid && m_ready))) different = different + 1;
      if (unknown("q", "a handshake", $isunknown(q_valid && q_ready))) different = different + 1;
      if (unknown("h", "a handshake", $isunknown(h_valid && h_ready))) different = different + 1;
      // The model has no X or Z: such records are not passed to it.
      if (s_valid && s_ready) begin
        if (unknown("s", "a record", $isunknown(s_data))) different = different + 1;
        else waiting = splatsim_dpi::step(model, splatsim_dpi::record_t'(s_data));
      end
      // A separate statement: simulators may evaluate both sides of an &&.
      if (drain && !s_valid && !has_ended) begin
        waiting = splatsim_dpi::splatsim_unit_end(model);
        if (waiting < 0) $fatal(1, "%s", splatsim_dpi::splatsim_last_error());
      end
      has_ended = drain && !s_valid;
      if (q_valid && q_ready) begin
        compare(splatsim_dpi::REQUEST, splatsim_dpi::record_t'(q_data), unknown("q", "a record", $isunknown(q_data)));
        forget_answer();
      end
      if (m_valid && m_ready)
        compare(splatsim_dpi::OUT, splatsim_dpi::record_t'(m_data), unknown("m", "a record", $isunknown(m_data)));
      if (h_valid && h_ready)
        compare(splatsim_dpi::HELD, splatsim_dpi::record_t'(h_data), unknown("h", "a record", $isunknown(h_data)));
      waiting = splatsim_dpi::splatsim_unit_waiting(model, splatsim_dpi::OUT)
        + splatsim_dpi::splatsim_unit_waiting(model, splatsim_dpi::REQUEST)
        + splatsim_dpi::splatsim_unit_waiting(model, splatsim_dpi::HELD);
    end
  end
  // verilator lint_on BLKSEQ
endmodule
/* verilator lint_on UNUSEDPARAM */
/* verilator lint_on DECLFILENAME */
`default_nettype wire
"#;
