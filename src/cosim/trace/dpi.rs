//! DPI: the live model for SystemVerilog: a function a unit, and modules that hold a device's
//! streams against it.

use rtl_model::pipeline::Elaborated;
use rtl_model::pipeline::ports::{self, Kind, Stream};
use rtl_model::records::unit;
use std::fmt::Write;

/// The package `splatsim_dpi`, and its modules. Functions are those of the C library, where a
/// `size_t` has 64 bits.
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
         // A unit keeps what it gave until it is taken (…_next) or compared.\n\
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
                "\n  // Gives {name} a record of {name}.in; how many records of {name}.out wait then.\n  \
                   function automatic longint {name}(chandle model, bit [machine_pkg::{upper}_IN_W-1:0] record);\n    \
                     return step(model, record_t'(record));\n  endfunction\n\n  \
                   // The next of these; 0 where there is none.\n  \
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

  // A unit by its name. A machine and a scene are names or files; the picture has so many columns and rows, or, of 0, the scene's own.
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

  // Gives a unit a record; how many wait at OUT then.
  function automatic longint step(chandle model, record_t record);
    longint waiting;
    waiting = splatsim_unit_step_bits(model, record, 64'(WORDS));
    if (waiting < 0) $fatal(1, "%s", splatsim_last_error());
    return waiting;
  endfunction

  // Takes the record that has waited longest; 0 where none waits.
  function automatic bit take(chandle model, int side, output record_t record);
    int there;
    there = splatsim_unit_next_bits(model, side, record, 64'(WORDS));
    if (there < 0) $fatal(1, "%s", splatsim_last_error());
    if (there == 0) record = '0;
    return there == 1;
  endfunction

  // Whether a device's record is what the model gave; says so where it is not.
  function automatic bit is_equal(chandle model, int side, record_t record);
    int differs;
    differs = splatsim_unit_compare_bits(model, side, record, 64'(WORDS));
    if (differs != 0) $display("splatsim: at %0d ns: %s", $time, splatsim_last_error());
    return differs == 0;
  endfunction

  // A record that the unit may be given: corners and thresholds on purpose, then random ones, for ever.
  function automatic record_t random(chandle model);
    record_t record;
    if (splatsim_unit_random_bits(model, record, 64'(WORDS)) != 0) $fatal(1, "%s", splatsim_last_error());
    return record;
  endfunction

  // What is constant in a frame: record `number` of "frame", "light", "material" or "reflection".
  function automatic record_t constant(chandle model, string name, int unsigned number);
    record_t record;
    if (splatsim_unit_constant_bits(model, name, 64'(number), record, 64'(WORDS)) != 1) $fatal(1, "%s: no record %0d", name, number);
    return record;
  endfunction
"#;

const MODULES: &str = r#"endpackage

// Holds a device's streams against the live model of its unit: s is what it takes, m what it gives; of fragment q is what it asks shade, h
// what it holds in the end. Streams that a unit has not are left out, and never valid. Bits that are X or Z count as different, whatever they mean.
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
  input wire clk,                  // everything happens at its rising edge
  input wire rst,                  // nothing does
  input wire s_valid,              // a record is offered
  input wire s_ready,              // and taken
  input wire [S_W-1:0] s_data,     // the record
  input wire m_valid,              // as s
  input wire m_ready,
  input wire [M_W-1:0] m_data,
  input wire q_valid,              // as s
  input wire q_ready,
  input wire [Q_W-1:0] q_data,
  input wire drain,                // no record comes any more until it falls: the frame ends
  input wire h_valid,              // as s
  input wire h_ready,
  input wire [H_W-1:0] h_data,
  output longint compared,         // records of the device that were compared
  output longint different,        // those that were not the model's, or X or Z in part
  output longint waiting           // records of the model that the device has not given
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

  // Whether a stream has a bit that is X or Z where it counts; says so.
  function automatic bit unknown(string stream, string what, bit is_so);
    if (is_so) $display("splatsim: at %0d ns: %s.%s: %s is X or Z in part", $time, UNIT, stream, what);
    return is_so;
  endfunction

  // Whoever asks shade has an answer that nobody compares.
  function automatic void forget_answer();
    splatsim_dpi::record_t answer;
    void'(splatsim_dpi::take(model, splatsim_dpi::ANSWER, answer));
  endfunction

  // A program: what it counts, the same cycle reads.
  // verilator lint_off BLKSEQ
  always @(posedge clk) begin
    if (!rst) begin
      // Where one side is 0 nothing happens, whatever the other is.
      if (unknown("s", "a handshake", $isunknown(s_valid && s_ready))) different = different + 1;
      if (unknown("m", "a handshake", $isunknown(m_valid && m_ready))) different = different + 1;
      if (unknown("q", "a handshake", $isunknown(q_valid && q_ready))) different = different + 1;
      if (unknown("h", "a handshake", $isunknown(h_valid && h_ready))) different = different + 1;
      // The model knows 0 and 1 only: what is neither is not given to it.
      if (s_valid && s_ready) begin
        if (unknown("s", "a record", $isunknown(s_data))) different = different + 1;
        else waiting = splatsim_dpi::step(model, splatsim_dpi::record_t'(s_data));
      end
      // By itself: simulators may call both sides of an &&.
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
