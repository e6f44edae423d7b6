// Shade: turns a fragment's sums into its light: normalise, Blinn-Phong, coverage. RTL
// implementation of units/shade.rs.
//
//   weight ->[ 1/W ]-+------------>(*)-> rgb, opacity ------------------->(*)-> colour ->(*)-> premultiplied
//   colour ->[ << ]--+-> share -----+                irradiance -----------+              |
//   normal ->[ << ]-> normal_share ->[ 1/|n| ]-> normal ->[ N.L, N.H ]-+-+ highlight ->(+) |
//   weight ->[ min(1, W/tau) ]-> coverage -------------------------------------------------+
//
// Sums are first shifted by the power of two that brings W to [1, 2), so that the colour of a
// thinly covered pixel keeps its precision.
//
// Losses: all words are rounded; opacity, coverage and colour are clamped to 1.
`timescale 1ns / 1ps
`default_nettype none

module shade #(
    parameter int TAG_W = 0, // bits of a tag, which passes through
    parameter ROMS = "rom/"  // folder of the tables, with its slash
) (
    input wire clk,                                               // clock, rising edge
    input wire rst,                                               // clears records in flight
    input wire [machine_pkg::FRAME_W-1:0] frame,                  // constants: the coverage threshold
    input wire [machine_pkg::LIGHTS_PORT_W-1:0] lights,           // constants: records of lights, the first in the lowest bits
    input wire [machine_pkg::MATERIALS_PORT_W-1:0] materials,     // constants: records of materials
    input wire [machine_pkg::REFLECTIONS_PORT_W-1:0] reflections, // constants: a record for each light of each material
    input wire s_valid,                                           // a fragment is there
    output wire s_ready,                                          // and can be taken
    input wire [TAG_W+machine_pkg::SHADE_IN_W-1:0] s_data,        // the tag, shade.in
    output wire m_valid,                                          // its light is offered
    input wire m_ready,                                           // and taken
    output wire [TAG_W+machine_pkg::SHADE_OUT_W-1:0] m_data       // the tag, shade.out
);
  // Without lights there is one black light, without materials one that reflects nothing.
  localparam int LIGHTS = machine_pkg::LIGHTS > 0 ? machine_pkg::LIGHTS : 1;
  localparam int MATERIALS = machine_pkg::MATERIALS > 0 ? machine_pkg::MATERIALS : 1;
  localparam int LIGHT_W = machine_pkg::LIGHT_W;
  localparam int REFLECTION_W = machine_pkg::REFLECTION_W;
  localparam int WEIGHT_W = machine_pkg::FRAGMENT_WEIGHT_SUM_W;
  localparam int SUM_W = machine_pkg::FRAGMENT_COLOUR_SUM_W;
  localparam int NORMAL_SUM_W = machine_pkg::FRAGMENT_NORMAL_SUM_W;
  localparam int OPACITY_SUM_W = machine_pkg::FRAGMENT_OPACITY_SUM_W;
  localparam int MATERIAL_W = machine_pkg::SHADE_IN_MATERIAL_W;
  localparam int SHARE_W = machine_pkg::SHADE_SHARE_W;
  localparam int SHARE_F = machine_pkg::SHADE_SHARE_F;
  localparam int REFLECTANCE_W = machine_pkg::SHADE_REFLECTANCE_W;
  localparam int REFLECTANCE_F = machine_pkg::SHADE_REFLECTANCE_F;
  localparam int COSINE_W = machine_pkg::SHADE_COSINE_W;
  localparam int COSINE_F = machine_pkg::SHADE_COSINE_F;
  localparam int HIGHLIGHT_W = machine_pkg::SHADE_HIGHLIGHT_W;
  localparam int PREMULTIPLIED_W = machine_pkg::SHADE_PREMULTIPLIED_W;

  wire [WEIGHT_W-1:0] weight = s_data[machine_pkg::SHADE_IN_WEIGHT_LSB+:WEIGHT_W];
  wire [OPACITY_SUM_W-1:0] opacity_sum = s_data[machine_pkg::SHADE_IN_OPACITY_LSB+:OPACITY_SUM_W];
  wire [MATERIAL_W-1:0] material = s_data[machine_pkg::SHADE_IN_MATERIAL_LSB+:MATERIAL_W];

  // 1/W; `places` is the shift of a sum that brings W to [1, 2).
  localparam int INVERSE_W = machine_pkg::SHADE_RECIPROCAL_BITS + 1;
  localparam int DIVIDED_W = SHARE_W + INVERSE_W;
  localparam int DIVIDED_F = SHARE_F + machine_pkg::SHADE_RECIPROCAL_BITS;
  wire [INVERSE_W-1:0] inverse;
  wire signed [7:0] exponent;
  wire signed [7:0] places = -exponent;
  reciprocal #(.IN_W(WEIGHT_W), .IN_F(machine_pkg::FRAGMENT_WEIGHT_SUM_F), .BITS(machine_pkg::SHADE_RECIPROCAL_BITS),
      .TABLE_BITS(machine_pkg::SHADE_RECIPROCAL_TABLE_BITS), .NEWTON_STEPS(machine_pkg::SHADE_RECIPROCAL_NEWTON_STEPS),
      .ROM({ROMS, "shade.reciprocal.hex"})) inverter (.x(weight), .mantissa(inverse), .exponent(exponent));

  // Opacity, of the fragment alone.
  localparam int OPACITY_W = machine_pkg::SHADE_OPACITY_W;
  localparam [OPACITY_W-1:0] OPACITY_ONE = OPACITY_W'(1) << machine_pkg::SHADE_OPACITY_F;
  wire [SHARE_W-1:0] opacity_share;
  fit_shifted #(.IN_W(OPACITY_SUM_W + 1), .PLACES(machine_pkg::FRAGMENT_OPACITY_SUM_F - SHARE_F), .MORE_W(8), .W(SHARE_W), .S(0),
      .ROUND(machine_pkg::SHADE_SHARE_ROUND), .WRAP(machine_pkg::SHADE_SHARE_WRAP))
      opacity_sharer (.exact($signed({1'b0, opacity_sum})), .more(places), .word(opacity_share));
  wire [DIVIDED_W-1:0] opacity_divided = opacity_share * inverse;
  wire [OPACITY_W-1:0] opacity_word;
  fit #(.IN_W(DIVIDED_W + 1), .PLACES(DIVIDED_F - machine_pkg::SHADE_OPACITY_F), .W(OPACITY_W), .S(0),
      .ROUND(machine_pkg::SHADE_OPACITY_ROUND), .WRAP(machine_pkg::SHADE_OPACITY_WRAP))
      opacity_divider (.exact($signed({1'b0, opacity_divided})), .word(opacity_word));
  wire [OPACITY_W-1:0] opacity = opacity_word > OPACITY_ONE ? OPACITY_ONE : opacity_word;

  // Coverage: min(1, W/tau).
  localparam int THRESHOLD_W = machine_pkg::SHADE_INVERSE_THRESHOLD_W;
  localparam int COVERAGE_W = machine_pkg::SHADE_COVERAGE_W;
  localparam [COVERAGE_W-1:0] COVERAGE_ONE = COVERAGE_W'(1) << machine_pkg::SHADE_COVERAGE_F;
  localparam int COVERED_W = SHARE_W + THRESHOLD_W;
  wire [WEIGHT_W-1:0] threshold = frame[machine_pkg::FRAME_COVERAGE_THRESHOLD_LSB+:WEIGHT_W];
  wire [THRESHOLD_W-1:0] inverse_threshold = frame[machine_pkg::FRAME_INVERSE_THRESHOLD_LSB+:THRESHOLD_W];
  wire signed [7:0] threshold_places = frame[machine_pkg::FRAME_INVERSE_THRESHOLD_PLACES_LSB+:8];
  wire [SHARE_W-1:0] weight_share;
  fit_shifted #(.IN_W(WEIGHT_W + 1), .PLACES(machine_pkg::FRAGMENT_WEIGHT_SUM_F - SHARE_F), .MORE_W(8), .W(SHARE_W), .S(0),
      .ROUND(machine_pkg::SHADE_SHARE_ROUND), .WRAP(machine_pkg::SHADE_SHARE_WRAP))
      weight_sharer (.exact($signed({1'b0, weight})), .more(places), .word(weight_share));
  wire [COVERED_W-1:0] covered = weight_share * inverse_threshold;
  wire signed [8:0] covered_places = 9'(exponent) + 9'(threshold_places);
  wire [COVERAGE_W-1:0] coverage_word;
  fit_shifted #(.IN_W(COVERED_W + 1), .PLACES(SHARE_F + machine_pkg::SHADE_INVERSE_THRESHOLD_F - machine_pkg::SHADE_COVERAGE_F),
      .MORE_W(9), .W(COVERAGE_W), .S(0), .ROUND(machine_pkg::SHADE_COVERAGE_ROUND), .WRAP(machine_pkg::SHADE_COVERAGE_WRAP))
      coverer (.exact($signed({1'b0, covered})), .more(covered_places), .word(coverage_word));
  wire [COVERAGE_W-1:0] coverage = weight >= threshold || coverage_word > COVERAGE_ONE ? COVERAGE_ONE : coverage_word;

  localparam int THINNED_W = OPACITY_W + COVERAGE_W;
  wire [THINNED_W-1:0] thinned = opacity * coverage;
  wire [PREMULTIPLIED_W-1:0] alpha;
  fit #(.IN_W(THINNED_W + 1),
      .PLACES(machine_pkg::SHADE_OPACITY_F + machine_pkg::SHADE_COVERAGE_F - machine_pkg::SHADE_PREMULTIPLIED_F), .W(PREMULTIPLIED_W),
      .S(0), .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND), .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP))
      thinner (.exact($signed({1'b0, thinned})), .word(alpha));

  // The unit normal, turned towards the viewer; zero if the sums cancel. It is shorter than 2, so
  // its word also holds its negative.
  localparam int NORMAL_SHARE_W = machine_pkg::SHADE_NORMAL_SHARE_W;
  localparam int NORMAL_SHARE_F = machine_pkg::SHADE_NORMAL_SHARE_F;
  localparam int SQUARE_W = 2 * NORMAL_SHARE_W - 1;
  localparam int SQUARED_W = SQUARE_W + 1;
  localparam int ROOT_W = machine_pkg::SHADE_ROOT_BITS + 1;
  localparam int UNIT_W = NORMAL_SHARE_W + ROOT_W;
  localparam int NORMAL_W = machine_pkg::SHADE_NORMAL_W;
  wire [ROOT_W-1:0] root;
  wire signed [7:0] root_exponent;
  wire signed [7:0] root_places = -root_exponent;
  wire [3*SQUARE_W-1:0] squares;
  wire [3*NORMAL_W-1:0] normal;
  wire turns;
  // X, y, z: from the MSB down.
  for (genvar axis = 0; axis < 3; axis++) begin : g_axis
    wire signed [NORMAL_SUM_W-1:0] sum = s_data[machine_pkg::SHADE_IN_NORMAL_X_LSB-axis*NORMAL_SUM_W+:NORMAL_SUM_W];
    wire signed [NORMAL_SHARE_W-1:0] share;
    fit_shifted #(.IN_W(NORMAL_SUM_W), .PLACES(machine_pkg::FRAGMENT_NORMAL_SUM_F - NORMAL_SHARE_F), .MORE_W(8), .W(NORMAL_SHARE_W),
        .S(1), .ROUND(machine_pkg::SHADE_NORMAL_SHARE_ROUND), .WRAP(machine_pkg::SHADE_NORMAL_SHARE_WRAP))
        sharer (.exact(sum), .more(places), .word(share));
    assign squares[axis*SQUARE_W+:SQUARE_W] = SQUARE_W'(share) * SQUARE_W'(share);

    wire signed [UNIT_W-1:0] divided = share * $signed({1'b0, root});
    wire signed [NORMAL_W-1:0] word;
    fit_shifted #(.IN_W(UNIT_W), .PLACES(NORMAL_SHARE_F + machine_pkg::SHADE_ROOT_BITS - machine_pkg::SHADE_NORMAL_F), .MORE_W(8),
        .W(NORMAL_W), .S(1), .ROUND(machine_pkg::SHADE_NORMAL_ROUND), .WRAP(machine_pkg::SHADE_NORMAL_WRAP))
        divider (.exact(divided), .more(root_places), .word(word));
    assign normal[(2-axis)*NORMAL_W+:NORMAL_W] = turns ? -word : word;
  end
  wire signed [NORMAL_W-1:0] forward = g_axis[2].word;
  assign turns = forward > NORMAL_W'(0);
  wire [SQUARED_W-1:0] squared =
      SQUARED_W'(squares[0+:SQUARE_W]) + SQUARED_W'(squares[SQUARE_W+:SQUARE_W]) + SQUARED_W'(squares[2*SQUARE_W+:SQUARE_W]);
  wire faces = squared != '0;
  wire [ROOT_W-1:0] unused_operand;
  reciprocal_root #(.IN_W(SQUARED_W), .IN_F(2 * NORMAL_SHARE_F), .BITS(machine_pkg::SHADE_ROOT_BITS),
      .TABLE_BITS(machine_pkg::SHADE_ROOT_TABLE_BITS), .NEWTON_STEPS(machine_pkg::SHADE_ROOT_NEWTON_STEPS), .ROM({ROMS, "shade.root.hex"}))
      rooter (.x(squared), .operand(unused_operand), .mantissa(root), .exponent(root_exponent));

  // The light reflected by the material.
  localparam int ANSWER_W = machine_pkg::MATERIAL_W;
  wire [MATERIALS*ANSWER_W-1:0] all_materials = machine_pkg::MATERIALS == 0 ? '0 : (MATERIALS * ANSWER_W)'(materials);
  wire [ANSWER_W-1:0] answer = ANSWER_W'(all_materials >> (32'(material) * ANSWER_W));
  wire unlit = answer[machine_pkg::MATERIAL_UNLIT_LSB];
  wire [REFLECTANCE_W-1:0] ambient = answer[machine_pkg::MATERIAL_AMBIENT_LSB+:REFLECTANCE_W];
  localparam int REFLECTIONS_W = MATERIALS * LIGHTS * REFLECTION_W;
  wire [REFLECTIONS_W-1:0] all_reflections = machine_pkg::LIGHTS == 0 ? '0 : REFLECTIONS_W'(reflections);
  wire [LIGHTS*REFLECTION_W-1:0] answers = (LIGHTS * REFLECTION_W)'(all_reflections >> (32'(material) * (LIGHTS * REFLECTION_W)));

  // Each light, and its highlight, from the material's table.
  localparam int DIRECTION_W = machine_pkg::SHADE_LIGHT_W;
  localparam int TOWARDS_W = COSINE_W - 1;
  localparam int MATERIAL_BITS = $clog2(MATERIALS);
  localparam int ANGLE_W = COSINE_F > 0 ? COSINE_F : 1;
  localparam int ARGUMENT_W = MATERIAL_BITS + ANGLE_W;
  // The last cosine below 1.
  localparam [TOWARDS_W-1:0] STEEPEST = (TOWARDS_W'(1) << COSINE_F) - TOWARDS_W'(1);
  wire [LIGHTS*LIGHT_W-1:0] all_lights = machine_pkg::LIGHTS == 0 ? '0 : (LIGHTS * LIGHT_W)'(lights);
  wire [LIGHTS*TOWARDS_W-1:0] towards;
  wire [LIGHTS*HIGHLIGHT_W-1:0] shine;
  for (genvar light = 0; light < LIGHTS; light++) begin : g_light
    wire [LIGHT_W-1:0] here = all_lights[light*LIGHT_W+:LIGHT_W];
    wire [TOWARDS_W-1:0] direct, half_way;
    shade_cosine sunny (.normal(normal), .direction(here[machine_pkg::LIGHT_DIRECTION_Z_LSB+:3*DIRECTION_W]), .cosine(direct));
    shade_cosine glossy (.normal(normal), .direction(here[machine_pkg::LIGHT_HALF_WAY_Z_LSB+:3*DIRECTION_W]), .cosine(half_way));
    assign towards[light*TOWARDS_W+:TOWARDS_W] = faces ? direct : '0;

    wire [ANGLE_W-1:0] angle = ANGLE_W'(half_way > STEEPEST ? STEEPEST : half_way);
    wire [HIGHLIGHT_W-1:0] highlight;
    lookup #(.ARGUMENT_W(ARGUMENT_W), .TABLE_BITS(MATERIAL_BITS + machine_pkg::SHADE_HIGHLIGHT_TABLE_BITS),
        .LINEAR(machine_pkg::SHADE_HIGHLIGHT_TABLE_LINEAR), .W(HIGHLIGHT_W), .ROUND(machine_pkg::SHADE_HIGHLIGHT_ROUND),
        .ROM({ROMS, "shade.highlights.hex"}), .LINES(MATERIALS << machine_pkg::SHADE_HIGHLIGHT_TABLE_BITS))
        power (.argument((ARGUMENT_W'(material) << ANGLE_W) | ARGUMENT_W'(angle)), .word(highlight));
    wire shines = faces && here[machine_pkg::LIGHT_HAS_HALF_WAY_LSB];
    assign shine[light*HIGHLIGHT_W+:HIGHLIGHT_W] = shines ? highlight : '0;
  end

  // Red, green, blue: from the MSB down.
  localparam int RGB_W = machine_pkg::SHADE_RGB_W;
  localparam int RGB_F = machine_pkg::SHADE_RGB_F;
  localparam int IRRADIANCE_W = machine_pkg::SHADE_IRRADIANCE_W;
  localparam int IRRADIANCE_F = machine_pkg::SHADE_IRRADIANCE_F;
  localparam int LIGHTING_W = TOWARDS_W + REFLECTANCE_W + $clog2(LIGHTS + 1);
  localparam int GLOSS_W = HIGHLIGHT_W + REFLECTANCE_W + $clog2(LIGHTS);
  localparam int GLOSS_F = machine_pkg::SHADE_HIGHLIGHT_F + REFLECTANCE_F;
  localparam int COLOURED_W = RGB_W + IRRADIANCE_W;
  localparam int COLOURED_F = RGB_F + IRRADIANCE_F;
  // Both with common fraction bits, and 1 with the same.
  localparam int BOTH_F = COLOURED_F > GLOSS_F ? COLOURED_F : GLOSS_F;
  localparam int COLOURED_LEFT = BOTH_F - COLOURED_F;
  localparam int GLOSS_LEFT = BOTH_F - GLOSS_F;
  localparam int BOTH_W = (COLOURED_W + COLOURED_LEFT > GLOSS_W + GLOSS_LEFT ? COLOURED_W + COLOURED_LEFT : GLOSS_W + GLOSS_LEFT) + 1;
  localparam [BOTH_W-1:0] BOTH_ONE = BOTH_W'(1) << BOTH_F;
  localparam int COLOUR_W = machine_pkg::SHADE_COLOUR_W;
  localparam int COLOUR_F = machine_pkg::SHADE_COLOUR_F;
  wire [3*PREMULTIPLIED_W-1:0] premultiplied;
  wire [3*COLOUR_W-1:0] lit, leaving;
  for (genvar channel = 0; channel < 3; channel++) begin : g_channel
    wire [SUM_W-1:0] sum = s_data[machine_pkg::SHADE_IN_COLOUR_R_LSB-channel*SUM_W+:SUM_W];
    wire [SHARE_W-1:0] share;
    fit_shifted #(.IN_W(SUM_W + 1), .PLACES(machine_pkg::FRAGMENT_COLOUR_SUM_F - SHARE_F), .MORE_W(8), .W(SHARE_W), .S(0),
        .ROUND(machine_pkg::SHADE_SHARE_ROUND), .WRAP(machine_pkg::SHADE_SHARE_WRAP))
        sharer (.exact($signed({1'b0, sum})), .more(places), .word(share));
    wire [DIVIDED_W-1:0] divided = share * inverse;
    wire [RGB_W-1:0] rgb;
    fit #(.IN_W(DIVIDED_W + 1), .PLACES(DIVIDED_F - RGB_F), .W(RGB_W), .S(0), .ROUND(machine_pkg::SHADE_RGB_ROUND),
        .WRAP(machine_pkg::SHADE_RGB_WRAP)) divider (.exact($signed({1'b0, divided})), .word(rgb));

    logic [LIGHTING_W-1:0] lighting;
    logic [GLOSS_W-1:0] gloss;
    always_comb begin
      lighting = LIGHTING_W'(ambient) << COSINE_F;
      gloss = '0;
      for (int light = 0; light < LIGHTS; light++) begin
        lighting = lighting + LIGHTING_W'(towards[light*TOWARDS_W+:TOWARDS_W]) * LIGHTING_W'(
            answers[light*REFLECTION_W+machine_pkg::REFLECTION_DIFFUSE_R_LSB-channel*REFLECTANCE_W+:REFLECTANCE_W]);
        gloss = gloss + GLOSS_W'(shine[light*HIGHLIGHT_W+:HIGHLIGHT_W]) * GLOSS_W'(
            answers[light*REFLECTION_W+machine_pkg::REFLECTION_SPECULAR_R_LSB-channel*REFLECTANCE_W+:REFLECTANCE_W]);
      end
    end
    wire [IRRADIANCE_W-1:0] irradiance;
    fit #(.IN_W(LIGHTING_W + 1), .PLACES(COSINE_F + REFLECTANCE_F - IRRADIANCE_F), .W(IRRADIANCE_W), .S(0),
        .ROUND(machine_pkg::SHADE_IRRADIANCE_ROUND), .WRAP(machine_pkg::SHADE_IRRADIANCE_WRAP))
        illuminator (.exact($signed({1'b0, lighting})), .word(irradiance));

    wire [COLOURED_W-1:0] coloured = rgb * irradiance;
    wire [BOTH_W-1:0] both =
        unlit ? BOTH_W'(rgb) << (BOTH_F - RGB_F) : (BOTH_W'(coloured) << COLOURED_LEFT) + (BOTH_W'(gloss) << GLOSS_LEFT);
    wire [BOTH_F:0] limited = (BOTH_F + 1)'(both > BOTH_ONE ? BOTH_ONE : both);
    wire [COLOUR_W-1:0] colour;
    fit #(.IN_W(BOTH_F + 2), .PLACES(BOTH_F - COLOUR_F), .W(COLOUR_W), .S(0), .ROUND(machine_pkg::SHADE_COLOUR_ROUND),
        .WRAP(machine_pkg::SHADE_COLOUR_WRAP)) limiter (.exact($signed({1'b0, limited})), .word(colour));
    assign lit[(2-channel)*COLOUR_W+:COLOUR_W] = colour;

    wire [COLOUR_W+PREMULTIPLIED_W-1:0] faded = leaving[(2-channel)*COLOUR_W+:COLOUR_W] * alpha;
    fit #(.IN_W(COLOUR_W + PREMULTIPLIED_W + 1), .PLACES(COLOUR_F), .W(PREMULTIPLIED_W), .S(0),
        .ROUND(machine_pkg::SHADE_PREMULTIPLIED_ROUND), .WRAP(machine_pkg::SHADE_PREMULTIPLIED_WRAP))
        fader (.exact($signed({1'b0, faded})), .word(premultiplied[(2-channel)*PREMULTIPLIED_W+:PREMULTIPLIED_W]));
  end

  // Only the package of a frame with an environment has this constant; its material records have
  // additional words.
`ifdef MACHINE_MIRRORS
  wire [3*COLOUR_W-1:0] mirrored;
`ifdef MACHINE_MIRRORS_ALONG_RAYS
  localparam int X_W = machine_pkg::SHADE_IN_X_W;
  localparam int Y_W = machine_pkg::SHADE_IN_Y_W;
  reflect #(.ROMS(ROMS)) mirror (.frame(frame), .x(s_data[machine_pkg::SHADE_IN_X_LSB+:X_W]), .y(s_data[machine_pkg::SHADE_IN_Y_LSB+:Y_W]),
      .normal(normal), .material(answer), .colour(lit), .leaving(mirrored));
`else
  reflect #(.ROMS(ROMS)) mirror (.normal(normal), .material(answer), .colour(lit), .leaving(mirrored));
`endif
  assign leaving = faces ? mirrored : lit;
`else
  assign leaving = lit;
`endif

  // An empty pixel has no light.
  wire [machine_pkg::SHADE_OUT_W-1:0] light = weight == '0 ? '0 : {premultiplied, alpha};
  // The tag passes through the registers and the FIFO.
  localparam int BEHIND_W = TAG_W + machine_pkg::SHADE_OUT_W;
  wire [BEHIND_W-1:0] labelled = BEHIND_W'({s_data >> machine_pkg::SHADE_IN_W, light});
  pipe #(.W(BEHIND_W), .LATENCY(machine_pkg::SHADE_LATENCY), .INTERVAL(machine_pkg::SHADE_INTERVAL), .ROOM(machine_pkg::SHADE_ROOM))
      behind (.clk(clk), .rst(rst), .s_valid(s_valid), .s_ready(s_ready), .s_keeps(1'b1), .s_data(labelled), .m_valid(m_valid),
      .m_ready(m_ready), .m_data(m_data));

  wire unused = &{1'b0, frame};
endmodule

`default_nettype wire
