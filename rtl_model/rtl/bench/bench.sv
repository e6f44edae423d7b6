// Bench: drives one RTL implementation with recorded inputs, writes its outputs, and checks the
// handshake. The same text for Icarus and Verilator. The assertions of handshake.sv, here and in
// handshakes.sv, are only for Verilator, because Icarus has no assertions over several cycles.
//
//   +in=FILE ->[ offer, sometimes not ]-> s ->( DUT )-> m ->[ take, sometimes not ]-> +out=FILE, +times=FILE
//
// Macros
//   DUT              the module
//   DUT_PARAMETERS   its parameters, such as .TAG_W(8); by default the module's defaults
//   IN_W, OUT_W      bits of its records
//   HAS_FRAME        it has the port frame
//   HAS_LIGHTING     it has the ports lights, materials and reflections
//   HAS_LEAST        it has the port least: 0, so that no weight is dropped
//   HAS_CORNER       it has the port corner: 0, the corner of a picture
//   HAS_DRAIN        it has the ports drain, which ends a frame, and drained, high when all of the frame was output
//   NETLIST          it is a netlist, whose memories have other names: the benches load none
// Arguments
//   +in=FILE         input records, one line of lower-case hex each
//   +out=FILE        file for the output records
//   +times=FILE      file for "s CYCLE" of each input record and "m CYCLE" of each output record; cycle 0 is the first after reset
//   +frame=FILE +light=FILE +material=FILE +reflection=FILE   the constants; by default frame.hex and so on
//   +stall_in=N +stall_out=N   percent of cycles in which no new record is offered; in which none is taken
//   +seed=N          of the stalls
//   +apart=N         cycles between a taken record and the next one's offer; the end of a frame is signalled at once
//   +apart_from=N    the first record of a frame, from 0, before which there are this many cycles
//   +expect=N        expected records per frame
//   +frames=N        number of times that the input is repeated, one frame after the other without a reset: the next one when all
//                    records of the one before were output and drained is high
//   +quiet=N         cycles to continue after the last input and output: further outputs are written too
//   +patience=N      cycles without a transfer after which the bench gives up

`timescale 1ns / 1ps
`default_nettype none
// A program, not hardware: a counter is read in the cycle in which it changes. The file of a task
// counts as unused if only $fgets reads it.
// verilator lint_off BLKSEQ
// verilator lint_off UNUSEDSIGNAL
module bench;
`ifdef HAS_FRAME
  localparam int FRAME_W = machine_pkg::FRAME_W;
`else
  localparam int FRAME_W = 1;
`endif
`ifdef HAS_LIGHTING
  localparam int CONSTANT_W = FRAME_W + machine_pkg::LIGHT_W + machine_pkg::MATERIAL_W + machine_pkg::REFLECTION_W;
`else
  localparam int CONSTANT_W = FRAME_W;
`endif
  // A line holds any record, and its newline.
  localparam int WIDEST = `IN_W > CONSTANT_W ? `IN_W : CONSTANT_W;
  localparam int LINE_CHARS = (WIDEST + 3) / 4 + 2;
  localparam int RECORD_W = 4 * LINE_CHARS;
  localparam int NAME_CHARS = 512;

  reg clk = 1'b0;
  reg rst = 1'b1;
  reg s_valid = 1'b0;
  reg [`IN_W-1:0] s_data = '0;
  reg m_ready = 1'b0;
  wire s_ready;
  wire m_valid;
  wire [`OUT_W-1:0] m_data;
`ifdef HAS_FRAME
  reg [machine_pkg::FRAME_W-1:0] frame = '0;
`endif
`ifdef HAS_LIGHTING
  reg [machine_pkg::LIGHTS_PORT_W-1:0] lights = '0;
  reg [machine_pkg::MATERIALS_PORT_W-1:0] materials = '0;
  reg [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections = '0;
`endif

`ifdef HAS_DRAIN
  reg drain = 1'b0;
  wire drained;
`else
  wire drained = 1'b1;
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
    .s_valid(s_valid),
    .s_ready(s_ready),
    .s_data(s_data),
    .m_valid(m_valid),
    .m_ready(m_ready),
    .m_data(m_data)
  );

  always #5 clk = !clk;

`ifdef VERILATOR
  handshake #(.W(`IN_W)) offers_in (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
  handshake #(.W(`OUT_W)) offers_out (.clk(clk), .rst(rst), .valid(m_valid), .ready(m_ready), .data(m_data));
`endif

  // Files and arguments.
  reg [8*NAME_CHARS-1:0] in_name;
  reg [8*NAME_CHARS-1:0] name;
  integer in_file;
  integer out_file;
  integer times_file = 0;
  integer stall_in;
  integer stall_out;
  integer apart;
  integer apart_from;
  integer expected;
  integer frames;
  integer quiet;
  integer patience;
  integer file_error;
  reg [31:0] chance_in;
  reg [31:0] chance_out;

  // The state of the bench.
  longint cycle = 0;
  longint records_in = 0;
  longint records_out = 0;
  longint idle = 0;
  longint complete_for = 0;
  longint violations = 0;
  // The current frame, from 1.
  longint at_frame = 1;
  longint taken_in_frame = 0;
  // Cycles until the record that was read can be offered.
  integer rest = 0;
  reg have_next = 1'b0;
  reg all_read = 1'b0;
  reg ended = 1'b0;

  // The output in the cycle before, if it was offered and not taken.
  reg waits = 1'b0;
  reg [`OUT_W-1:0] waiting = '0;

  // The last line, and its record.
  reg [8*LINE_CHARS-1:0] line;
  reg [RECORD_W-1:0] record;
  reg have_record;

  function automatic [31:0] xorshift(input [31:0] state);
    reg [31:0] x;
    begin
      x = state ^ (state << 13);
      x = x ^ (x >> 17);
      xorshift = x ^ (x << 5);
    end
  endfunction

  task automatic finish;
    begin
      ended = 1'b1;
      if (out_file != 0) $fclose(out_file);
      if (times_file != 0) $fclose(times_file);
      $finish(0);
    end
  endtask

  // Reads a line of this many bits into `record`; at the file's end `have_record` is 0.
  task automatic read_record(input integer file, input integer bits, input longint number);
    integer chars;
    integer digits;
    integer at;
    reg [7:0] char;
    reg is_hex;
    begin
      digits = (bits + 3) / 4;
      chars = $fgets(line, file);
      have_record = chars != 0;
      record = '0;
      if (have_record) begin
        // The last line may have no newline.
        if (line[7:0] == "\n") begin
          line = line >> 8;
          chars = chars - 1;
        end
        is_hex = 1'b1;
        // A longer record is not parsed: it fails by its length.
        for (at = 0; at < digits; at = at + 1) begin
          char = line[8*at+:8];
          if (char >= "0" && char <= "9") record[4*at+:4] = char[3:0];
          else if (char >= "a" && char <= "f") record[4*at+:4] = char[3:0] + 4'd9;
          else is_hex = 1'b0;
        end
        if (chars != digits || !is_hex || |(record >> bits)) begin
          if (!ended) begin
            $display("bench: FAILED line %0d of %0s is not %0d lower-case hex digits of %0d bits: %0s", number + 1, name,
              digits, bits, line);
          end
          have_record = 1'b0;
          finish;
        end
      end
    end
  endtask

  // Opens the file `name`.
  task automatic open_to_read(output integer file);
    begin
      file = $fopen(name, "r");
      if (file == 0) begin
        $display("bench: FAILED cannot read %0s", name);
        finish;
      end
    end
  endtask

`ifdef HAS_LIGHTING
  task automatic check_count(input integer count, input integer wanted);
    begin
      if (count != wanted && !ended) begin
        $display("bench: FAILED %0s has not %0d records, as the package says, but %0d", name, wanted, count);
        finish;
      end
    end
  endtask
`endif

`ifdef HAS_FRAME
  task automatic read_constants;
    integer file;
    integer count;
    begin
      if ($value$plusargs("frame=%s", name) == 0) name = "frame.hex";
      open_to_read(file);
      if (!ended) read_record(file, machine_pkg::FRAME_W, 0);
      if (!ended) begin
        frame = record[machine_pkg::FRAME_W-1:0];
        count = have_record ? 1 : 0;
        if (have_record) read_record(file, machine_pkg::FRAME_W, 1);
        if (!ended && (count != 1 || have_record)) begin
          $display("bench: FAILED %0s has not one record", name);
          finish;
        end
        $fclose(file);
      end
`ifdef HAS_LIGHTING
      if (!ended) begin
        if ($value$plusargs("light=%s", name) == 0) name = "light.hex";
        open_to_read(file);
        count = -1;
        have_record = !ended;
        while (have_record) begin
          count = count + 1;
          read_record(file, machine_pkg::LIGHT_W, longint'(count));
          lights = lights | machine_pkg::LIGHTS_PORT_W'(record) << (count * machine_pkg::LIGHT_W);
        end
        check_count(count, machine_pkg::LIGHTS);
      end
      if (!ended) begin
        if ($value$plusargs("material=%s", name) == 0) name = "material.hex";
        open_to_read(file);
        count = -1;
        have_record = !ended;
        while (have_record) begin
          count = count + 1;
          read_record(file, machine_pkg::MATERIAL_W, longint'(count));
          materials = materials | machine_pkg::MATERIALS_PORT_W'(record) << (count * machine_pkg::MATERIAL_W);
        end
        check_count(count, machine_pkg::MATERIALS);
      end
      if (!ended) begin
        if ($value$plusargs("reflection=%s", name) == 0) name = "reflection.hex";
        open_to_read(file);
        count = -1;
        have_record = !ended;
        while (have_record) begin
          count = count + 1;
          read_record(file, machine_pkg::REFLECTION_W, longint'(count));
          reflections = reflections | machine_pkg::REFLECTIONS_PORT_W'(record) << (count * machine_pkg::REFLECTION_W);
        end
        check_count(count, machine_pkg::MATERIALS * machine_pkg::LIGHTS);
      end
`endif
    end
  endtask
`endif

  initial begin
    out_file = 0;
    if ($value$plusargs("stall_in=%d", stall_in) == 0) stall_in = 0;
    if ($value$plusargs("stall_out=%d", stall_out) == 0) stall_out = 0;
    if ($value$plusargs("apart=%d", apart) == 0) apart = 0;
    if ($value$plusargs("apart_from=%d", apart_from) == 0) apart_from = 0;
    if ($value$plusargs("expect=%d", expected) == 0) expected = -1;
    if ($value$plusargs("frames=%d", frames) == 0) frames = 1;
    if ($value$plusargs("quiet=%d", quiet) == 0) quiet = 1000;
    if ($value$plusargs("patience=%d", patience) == 0) patience = 100000;
    if ($value$plusargs("seed=%d", chance_in) == 0) chance_in = 1;
    // Xorshift never leaves 0.
    chance_in = chance_in == 0 ? 32'h9e3779b9 : chance_in;
    chance_out = chance_in ^ 32'h85ebca6b;
    chance_out = chance_out == 0 ? 32'hc2b2ae35 : chance_out;
`ifdef HAS_FRAME
    read_constants;
`endif
    if (!ended && $value$plusargs("out=%s", name) != 0) begin
      out_file = $fopen(name, "w");
      if (out_file == 0) begin
        $display("bench: FAILED cannot write %0s", name);
        finish;
      end
    end
    if (!ended && $value$plusargs("times=%s", name) != 0) begin
      times_file = $fopen(name, "w");
      if (times_file == 0) begin
        $display("bench: FAILED cannot write %0s", name);
        finish;
      end
    end
    if (!ended) begin
      if ($value$plusargs("in=%s", in_name) == 0) begin
        $display("bench: FAILED +in=FILE is missing");
        finish;
      end else begin
        name = in_name;
        open_to_read(in_file);
      end
    end
  end

  // Reset for three edges; at the last one the first record is prepared for cycle 0.
  integer edges = 0;
  wire last_of_reset = edges == 2;
  always @(posedge clk) edges <= edges < 3 ? edges + 1 : edges;

  always @(posedge clk) begin
    if (!ended) begin
      if (last_of_reset) rst <= 1'b0;
      if (last_of_reset || !rst) begin
        chance_in = xorshift(chance_in);
        chance_out = xorshift(chance_out);
        // An offer stays until it is taken.
        if (!s_valid || s_ready) begin
          s_valid <= 1'b0;
          if (s_valid) begin
            taken_in_frame = taken_in_frame + 1;
            rest = taken_in_frame >= longint'(apart_from) ? apart : 0;
          end else if (rest > 0) rest = rest - 1;
          if (!all_read && !have_next && (rest > 0 || chance_in % 100 >= stall_in)) begin
            read_record(in_file, `IN_W, records_in + (s_valid ? 1 : 0));
            all_read = !have_record;
            have_next = have_record;
          end
          if (have_next && rest == 0 && chance_in % 100 >= stall_in) begin
            s_valid <= 1'b1;
            s_data <= record[`IN_W-1:0];
            have_next = 1'b0;
          end
        end
`ifdef HAS_DRAIN
        drain <= all_read;
`endif
        m_ready <= chance_out % 100 >= stall_out;
      end
    end
    if (!ended && !rst) begin
      if (times_file != 0) begin
        if (s_valid && s_ready) $fwrite(times_file, "s %0d\n", cycle);
        if (m_valid && m_ready) $fwrite(times_file, "m %0d\n", cycle);
      end
      if (m_valid && m_ready && out_file != 0) $fwrite(out_file, "%h\n", m_data);

      // The handshake: offered records have no unknown bits, and stay until they are taken.
      if ((s_ready ^ s_ready) !== 1'b0 || (m_valid ^ m_valid) !== 1'b0) begin
        violations = violations + 1;
        if (violations <= 10) $display("bench: in cycle %0d s_ready is %b and m_valid is %b", cycle, s_ready, m_valid);
      end
      if (m_valid && (^m_data ^ ^m_data) !== 1'b0) begin
        violations = violations + 1;
        if (violations <= 10) $display("bench: in cycle %0d the output is not known: %h", cycle, m_data);
      end
      if (waits && (!m_valid || m_data !== waiting)) begin
        violations = violations + 1;
        if (violations <= 10) begin
          $display("bench: in cycle %0d the output, offered before and not taken, %0s", cycle,
            m_valid ? "has changed" : "is gone");
        end
      end
      waits = m_valid && !m_ready;
      waiting = m_data;

      if (s_valid && s_ready) records_in = records_in + 1;
      if (m_valid && m_ready) records_out = records_out + 1;
      cycle = cycle + 1;
      idle = s_valid && s_ready || m_valid && m_ready ? 0 : idle + 1;
      if (all_read && drained && expected >= 0 && records_out >= at_frame * longint'(expected)) complete_for = complete_for + 1;
      // The next frame, while drained is still high.
      if (complete_for > 0 && at_frame < longint'(frames)) begin
        at_frame = at_frame + 1;
        taken_in_frame = 0;
        complete_for = 0;
        file_error = $rewind(in_file);
        all_read = 1'b0;
`ifdef HAS_DRAIN
        drain <= 1'b0;
`endif
      end
      // A unit with a broken handshake may never end.
      if (complete_for > longint'(quiet) || idle >= longint'(patience) || violations > 10) begin
        if (violations != 0) begin
          $display("bench: FAILED %0d violations of the handshake, in=%0d out=%0d cycles=%0d", violations, records_in,
            records_out, cycle);
        end else if (at_frame != longint'(frames)) begin
          $display("bench: FAILED frame %0d of %0d does not end, in=%0d out=%0d cycles=%0d", at_frame, frames, records_in,
            records_out, cycle);
        end else if (expected >= 0 && records_out != at_frame * longint'(expected)) begin
          $display("bench: FAILED %0d records were to come, in=%0d out=%0d cycles=%0d", at_frame * longint'(expected),
            records_in, records_out, cycle);
        end else if (!all_read || s_valid) begin
          $display("bench: FAILED nothing moved for %0d cycles and not all is in, in=%0d out=%0d cycles=%0d", idle,
            records_in, records_out, cycle);
        end else begin
          if (expected < 0) $display("bench: nothing moved for %0d cycles", idle);
          $display("bench: done in=%0d out=%0d cycles=%0d", records_in, records_out, cycle);
        end
        finish;
      end
    end
  end
endmodule
// verilator lint_on UNUSEDSIGNAL
// verilator lint_on BLKSEQ

`default_nettype wire
