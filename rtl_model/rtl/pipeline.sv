// Pipeline: wires the units, the only file that knows their order. Twin of pipeline.rs, for a picture whose fragments all fit on the chip.
//
//   splats -> project -> ellipse -> raster -> gauss -> fragment -+-> layers -> resolve -> frame
//                                                       +--> shade <--+
//
// Splats go in one after the other; when the last one is in, `drain` makes everything that the pixels hold come out, pixel by pixel. A
// splat that project or ellipse finds culled, and a weight of 0, ends where that is found: it waits in no FIFO and takes no cycle of the
// next unit, as in the timing model. What a unit does not need goes through it as its tag.
`default_nettype none

module pipeline #(
    parameter int WIDTH = 16, // columns of the picture
    parameter int HEIGHT = 16 // rows of the picture
) (
    input wire clk,                                               // everything happens at its rising edge
    input wire rst,                                               // empties everything
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constants: the view
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,           // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,     // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections, // constants: a record for each light of each material
    input wire s_valid,                                           // a splat is there
    output wire s_ready,                                          // and can be taken
    input wire [machine_pkg::PIPELINE_IN_W-1:0] s_data,           // pipeline.in
    input wire drain,                                             // no splat comes any more: hand out the picture
    output wire drained,                                          // resolve has all of it, until drain falls
    output wire m_valid,                                          // a pixel is offered
    input wire m_ready,                                           // and taken
    output wire [machine_pkg::PIPELINE_OUT_W-1:0] m_data          // pipeline.out
);
  localparam int POSITION_W = machine_pkg::PROJECT_IN_W;
  localparam int DISC_W = 3 * machine_pkg::SPLAT_NORMAL_W + machine_pkg::SPLAT_RADIUS_W;
  localparam int RGB_W = 3 * machine_pkg::SPLAT_RGB_W;
  localparam int OPACITY_W = machine_pkg::SPLAT_OPACITY_W;
  localparam int MATERIAL_W = machine_pkg::PIPELINE_IN_MATERIAL_W;
  localparam int NORMAL_W = 3 * machine_pkg::FRAGMENT_NORMAL_W;
  localparam int AMPLITUDE_W = machine_pkg::ELLIPSE_AMPLITUDE_W;
  localparam int RADIAL_W = machine_pkg::RASTER_RADIAL_W;
  localparam int DEPTH_W = machine_pkg::RASTER_OUT_DEPTH_W;
  localparam int WEIGHT_W = machine_pkg::GAUSS_WEIGHT_W;
  localparam int X_W = machine_pkg::RASTER_OUT_X_W;
  localparam int Y_W = machine_pkg::RASTER_OUT_Y_W;
  // Colour, opacity and material: what a splat looks like. Its normal, in camera space, comes from ellipse.
  localparam int LOOK_W = RGB_W + OPACITY_W + MATERIAL_W;

  // Project.

  wire point_valid, point_taken;
  wire [machine_pkg::PROJECT_OUT_W-1:0] point;
  wire [DISC_W-1:0] disc;
  wire [LOOK_W-1:0] look;
  project #(.DROPS(1), .TAG_W(DISC_W + LOOK_W)) project (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(s_valid),
      .s_ready(s_ready),
      .s_data({s_data[DISC_W+LOOK_W-1:0], s_data[machine_pkg::PIPELINE_IN_POSITION_Z_LSB+:POSITION_W]}),
      .m_valid(point_valid),
      .m_ready(point_taken),
      .m_data({disc, look, point})
  );

  // Ellipse.

  wire [machine_pkg::PROJECT_DEPTH_W-1:0] depth = point[machine_pkg::PROJECT_OUT_DEPTH_LSB+:machine_pkg::PROJECT_DEPTH_W];
  wire [2*machine_pkg::PROJECT_PIXEL_W-1:0] pixel = point[machine_pkg::PROJECT_OUT_PIXEL_Y_LSB+:2*machine_pkg::PROJECT_PIXEL_W];
  wire ellipse_valid, ellipse_taken;
  wire [machine_pkg::ELLIPSE_OUT_W-1:0] footprint;
  wire [machine_pkg::PROJECT_DEPTH_W-1:0] raster_depth;
  wire [2*machine_pkg::PROJECT_PIXEL_W-1:0] raster_pixel;
  wire [RGB_W+OPACITY_W-1:0] raster_rgba;
  wire [MATERIAL_W-1:0] raster_material;
  ellipse #(.DROPS(1), .TAG_W(machine_pkg::PROJECT_DEPTH_W + 2 * machine_pkg::PROJECT_PIXEL_W + LOOK_W)) ellipse (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(point_valid),
      .s_ready(point_taken),
      .s_data({
        depth,
        pixel,
        look,
        disc,
        point[machine_pkg::PROJECT_OUT_FORWARD_LSB+:machine_pkg::PROJECT_OUT_FORWARD_W],
        point[machine_pkg::PROJECT_OUT_EXPONENT_LSB+:machine_pkg::PROJECT_OUT_EXPONENT_W],
        point[machine_pkg::PROJECT_OUT_DEPTH_LSB-1:0]
      }),
      .m_valid(ellipse_valid),
      .m_ready(ellipse_taken),
      .m_data({raster_depth, raster_pixel, raster_rgba, raster_material, footprint})
  );

  // Raster.

  localparam int TAG_W = LOOK_W + NORMAL_W + AMPLITUDE_W;
  wire [AMPLITUDE_W-1:0] amplitude = footprint[machine_pkg::ELLIPSE_OUT_AMPLITUDE_LSB+:AMPLITUDE_W];
  wire [NORMAL_W-1:0] normal = footprint[machine_pkg::ELLIPSE_OUT_NORMAL_Z_LSB+:NORMAL_W];
  localparam int CONIC_W = 2 * machine_pkg::ELLIPSE_CONIC_W + machine_pkg::ELLIPSE_CONIC_CROSS_W;
  localparam int BOX_W = 2 * machine_pkg::RASTER_IN_FIRST_COLUMN_W + 2 * machine_pkg::RASTER_IN_FIRST_ROW_W;
  localparam int PLANE_W = 2 * machine_pkg::ELLIPSE_DEPTH_SLOPE_W + machine_pkg::ELLIPSE_DEPTH_RANGE_W;
  wire fragment_valid, fragment_taken;
  wire [RGB_W+OPACITY_W-1:0] rgba;
  wire [NORMAL_W-1:0] fragment_normal;
  wire [MATERIAL_W-1:0] material;
  wire [AMPLITUDE_W-1:0] fragment_amplitude;
  wire [X_W-1:0] x;
  wire [Y_W-1:0] y;
  wire [RADIAL_W-1:0] radial;
  wire [DEPTH_W-1:0] fragment_depth;
  raster #(.TAG_W(TAG_W)) raster (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(ellipse_valid),
      .s_ready(ellipse_taken),
      .s_data({
        raster_rgba,
        normal,
        raster_material,
        amplitude,
        raster_pixel,
        footprint[machine_pkg::ELLIPSE_OUT_CONIC_YY_LSB+:CONIC_W],
        raster_depth,
        footprint[machine_pkg::ELLIPSE_OUT_DEPTH_RANGE_LSB+:PLANE_W],
        footprint[machine_pkg::ELLIPSE_OUT_LAST_ROW_LSB+:BOX_W]
      }),
      .m_valid(fragment_valid),
      .m_ready(fragment_taken),
      .m_data({rgba, fragment_normal, material, fragment_amplitude, x, y, radial, fragment_depth})
  );

  // Gauss.

  localparam int ATTRIBUTES_W = DEPTH_W + RGB_W + OPACITY_W + NORMAL_W + MATERIAL_W;
  wire weight_valid, weight_taken;
  wire [WEIGHT_W-1:0] weight;
  wire [X_W+Y_W-1:0] weighed_pixel;
  wire [ATTRIBUTES_W-1:0] weighed_attributes;
  gauss #(.DROPS(1), .TAG_W(X_W + Y_W + ATTRIBUTES_W)) gauss (
      .clk(clk),
      .rst(rst),
      .s_valid(fragment_valid),
      .s_ready(fragment_taken),
      .s_data({x, y, fragment_depth, rgba, fragment_normal, material, radial, fragment_amplitude}),
      .m_valid(weight_valid),
      .m_ready(weight_taken),
      .m_data({weighed_pixel, weighed_attributes, weight})
  );

  // Nothing is under way where raster takes a splat, which it does not while it walks, and nothing has come out of any unit for as long as
  // a record takes in the slowest of them.
  localparam int SETUP =
      machine_pkg::PROJECT_LATENCY > machine_pkg::ELLIPSE_LATENCY ? machine_pkg::PROJECT_LATENCY : machine_pkg::ELLIPSE_LATENCY;
  localparam int FILL = machine_pkg::RASTER_LATENCY > machine_pkg::GAUSS_LATENCY ? machine_pkg::RASTER_LATENCY : machine_pkg::GAUSS_LATENCY;
  localparam int SLOWEST = SETUP > FILL ? SETUP : FILL;
  localparam int SILENCE_W = $clog2(SLOWEST + 1);
  logic [SILENCE_W-1:0] silence;
  wire quiet = !s_valid && !point_valid && !ellipse_valid && ellipse_taken && !fragment_valid && !weight_valid;
  wire silent = silence == SILENCE_W'(SLOWEST);
  always_ff @(posedge clk) begin
    if (rst || !quiet) silence <= '0;
    else if (!silent) silence <= silence + SILENCE_W'(1);
  end

  // Fragment.

  wire asks, asked, answered, answer_ready;
  wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] request;
  wire [machine_pkg::FRAGMENT_ANSWER_W-1:0] light;
  wire held_valid, held_ready, held_last, held_empty;
  wire [machine_pkg::FRAGMENT_HELD_W-1:0] held;
  wire all_held;
  // What became of a contribution interests nobody here.
  // verilator lint_off PINCONNECTEMPTY
  fragment #(.WIDTH(WIDTH), .HEIGHT(HEIGHT)) fragment (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(weight_valid),
      .s_ready(weight_taken),
      .s_data({weighed_pixel, weight, weighed_attributes}),
      .m_valid(),
      .m_ready(1'b1),
      .m_data(),
      .q_valid(asks),
      .q_ready(asked),
      .q_data(request),
      .a_valid(answered),
      .a_ready(answer_ready),
      .a_data(light),
      .drain(drain && silent),
      .drained(all_held),
      .h_valid(held_valid),
      .h_ready(held_ready),
      .h_last(held_last),
      .h_empty(held_empty),
      .h_data(held)
  );
  // verilator lint_on PINCONNECTEMPTY

  // Layers: what is held, lit where it was not yet. Shade is fragment's as long as nothing is handed out.

  localparam int LIGHT_W = machine_pkg::FRAGMENT_ANSWER_W;
  localparam int LAYER_W = X_W + Y_W + 2;
  wire [LAYER_W-1:0] layer = {held[machine_pkg::FRAGMENT_HELD_Y_LSB+:X_W+Y_W], held_last, held_empty};
  wire held_shaded = held[machine_pkg::FRAGMENT_HELD_SHADED_LSB];
  wire held_dark = !held_empty && !held_shaded;
  wire [LIGHT_W-1:0] held_light = held_empty ? '0 : held[machine_pkg::FRAGMENT_HELD_LIT_OPACITY_LSB+:LIGHT_W];
  wire shade_ready, lit_valid, lit_ready;
  wire layers_full, layers_empty;
  wire dark_asks = held_valid && held_dark && !layers_full;
  wire layer_ready;
  wire layer_dark;
  wire [LAYER_W-1:0] layer_out;
  wire [LIGHT_W-1:0] layer_light;
  assign held_ready = !layers_full && (!held_dark || shade_ready);
  fifo #(.W(LAYER_W + 1 + LIGHT_W), .PLACES(machine_pkg::SHADE_ROOM)) layers (
      .clk(clk),
      .rst(rst),
      .push(held_valid && held_ready),
      .s_data({layer, held_dark, held_light}),
      .pop(layer_ready && !layers_empty && (!layer_dark || lit_valid)),
      .m_data({layer_out, layer_dark, layer_light}),
      .empty(layers_empty),
      .full(layers_full)
  );

  // Shade.

  localparam int SUMS_W = machine_pkg::FRAGMENT_REQUEST_W - MATERIAL_W;
  wire [machine_pkg::FRAGMENT_REQUEST_W-1:0] dark = {
    held[machine_pkg::FRAGMENT_HELD_NORMAL_Z_LSB+:SUMS_W], held[machine_pkg::FRAGMENT_HELD_MATERIAL_LSB+:MATERIAL_W]
  };
  assign asked = shade_ready;
  assign answered = lit_valid && layers_empty;
  assign lit_ready = layers_empty ? answer_ready : layer_dark && layer_ready;
  shade shade (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .lights(lights),
      .materials(materials),
      .reflections(reflections),
      .s_valid(asks || dark_asks),
      .s_ready(shade_ready),
      .s_data(asks ? request : dark),
      .m_valid(lit_valid),
      .m_ready(lit_ready),
      .m_data(light)
  );

  // Resolve.

  resolve resolve (
      .clk(clk),
      .rst(rst),
      .frame(frame),
      .s_valid(!layers_empty && (!layer_dark || lit_valid)),
      .s_ready(layer_ready),
      .s_data({layer_out, layer_dark ? light : layer_light}),
      .m_valid(m_valid),
      .m_ready(m_ready),
      .m_data(m_data)
  );
  assign drained = all_held && layers_empty;

  // What comes out of project and ellipse is not culled: those bits nobody looks at.
  wire unused = &{1'b0, point, footprint};
endmodule

`default_nettype wire
