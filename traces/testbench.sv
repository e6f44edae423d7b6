// Testbench: drives recorded records into the raster, checks its outputs and writes them to a file.
// It is the smallest bench for a trace. Run it with testbench.sh.
//
//   raster.in.hex ─► s ─►( raster )─► m ─► raster.out.hex, record by record
//                                      └─► the file of +out=FILE, a record per line, for `splatsim diff`

`timescale 1ns / 1ps
`default_nettype none
module testbench;
  // Number of records, from manifest.json, passed by testbench.sh.
  parameter int IN_RECORDS = 1;
  parameter int OUT_RECORDS = 1;
  localparam int IN_W = machine_pkg::RASTER_IN_W;
  localparam int OUT_W = machine_pkg::RASTER_OUT_W;

  reg clk = 1'b0;
  reg rst = 1'b1;
  reg [machine_pkg::FRAME_W-1:0] frame[0:0];
  reg [IN_W-1:0] in[0:IN_RECORDS-1];
  reg [OUT_W-1:0] out[0:OUT_RECORDS-1];
  integer sent = 0;
  integer seen = 0;
  integer wrong = 0;
  integer cycles = 0;
  string path;
  integer given = 0;

  wire s_valid = !rst && sent < IN_RECORDS;
  wire s_ready;
  wire m_valid;
  wire [OUT_W-1:0] m_data;

  raster raster (
    .clk(clk),
    .rst(rst),
    .frame(frame[0]),
    .corner({(machine_pkg::RASTER_OUT_X_W + machine_pkg::RASTER_OUT_Y_W) {1'b0}}),
    .s_valid(s_valid),
    .s_ready(s_ready),
    .s_data(in[s_valid ? sent : 0]),
    .m_valid(m_valid),
    .m_ready(1'b1),
    .m_data(m_data)
  );

  initial begin
    $readmemh("frame.hex", frame);
    $readmemh("raster.in.hex", in);
    $readmemh("raster.out.hex", out);
    if ($value$plusargs("out=%s", path) != 0) given = $fopen(path, "w");
  end

  always #5 clk = !clk;

  always @(posedge clk) begin
    rst <= cycles < 2;
    cycles <= cycles + 1;
    if (s_valid && s_ready) sent <= sent + 1;
    if (m_valid) begin
      // %h writes all digits of the record.
      if (given != 0) $fdisplay(given, "%h", m_data);
      if (seen >= OUT_RECORDS || m_data !== out[seen]) begin
        if (wrong == 0) $display("record %0d: %h expected, %h given", seen, out[seen], m_data);
        wrong <= wrong + 1;
      end
      seen <= seen + 1;
    end
    // A box has at most 256 pixels here: by then all outputs must have come.
    if (cycles == 256 * IN_RECORDS + 1000) begin
      if (wrong == 0 && sent == IN_RECORDS && seen == OUT_RECORDS) $display("%0d records equal", seen);
      else $display("FAILED: %0d of %0d taken, %0d of %0d given, %0d wrong", sent, IN_RECORDS, seen, OUT_RECORDS, wrong);
      $finish;
    end
  end
endmodule
`default_nettype wire
