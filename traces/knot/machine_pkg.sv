// Formats, rules, timing and records of the machine tiny, written by splatsim 0.1.0.
// For each word: _W bits, _F fraction bits, _S signed, _ROUND 0 truncate, 1 nearest, 2 nearest-even, _WRAP 0 saturate, 1 wrap.
// For each record: _W bits, and _LSB and _W of each field.
`timescale 1ns / 1ps
`default_nettype none
/* verilator lint_off UNUSEDPARAM */
package machine_pkg;

  // ellipse.amplitude: U-2F10
  localparam int ELLIPSE_AMPLITUDE_W = 8; localparam int ELLIPSE_AMPLITUDE_F = 10; localparam int ELLIPSE_AMPLITUDE_S = 0; localparam int ELLIPSE_AMPLITUDE_ROUND = 1; localparam int ELLIPSE_AMPLITUDE_WRAP = 0;

  // ellipse.area: I3F7
  localparam int ELLIPSE_AREA_W = 10; localparam int ELLIPSE_AREA_F = 7; localparam int ELLIPSE_AREA_S = 1; localparam int ELLIPSE_AREA_ROUND = 1; localparam int ELLIPSE_AREA_WRAP = 0;

  // ellipse.conic: U2F8
  localparam int ELLIPSE_CONIC_W = 10; localparam int ELLIPSE_CONIC_F = 8; localparam int ELLIPSE_CONIC_S = 0; localparam int ELLIPSE_CONIC_ROUND = 1; localparam int ELLIPSE_CONIC_WRAP = 0;

  // ellipse.conic_cross: I2F8
  localparam int ELLIPSE_CONIC_CROSS_W = 10; localparam int ELLIPSE_CONIC_CROSS_F = 8; localparam int ELLIPSE_CONIC_CROSS_S = 1; localparam int ELLIPSE_CONIC_CROSS_ROUND = 1; localparam int ELLIPSE_CONIC_CROSS_WRAP = 0;

  // ellipse.depth_range: U-3F11
  localparam int ELLIPSE_DEPTH_RANGE_W = 8; localparam int ELLIPSE_DEPTH_RANGE_F = 11; localparam int ELLIPSE_DEPTH_RANGE_S = 0; localparam int ELLIPSE_DEPTH_RANGE_ROUND = 1; localparam int ELLIPSE_DEPTH_RANGE_WRAP = 0;

  // ellipse.depth_slope: I1F10
  localparam int ELLIPSE_DEPTH_SLOPE_W = 11; localparam int ELLIPSE_DEPTH_SLOPE_F = 10; localparam int ELLIPSE_DEPTH_SLOPE_S = 1; localparam int ELLIPSE_DEPTH_SLOPE_ROUND = 1; localparam int ELLIPSE_DEPTH_SLOPE_WRAP = 0;

  // ellipse.depth_step: U1F8
  localparam int ELLIPSE_DEPTH_STEP_W = 9; localparam int ELLIPSE_DEPTH_STEP_F = 8; localparam int ELLIPSE_DEPTH_STEP_S = 0; localparam int ELLIPSE_DEPTH_STEP_ROUND = 1; localparam int ELLIPSE_DEPTH_STEP_WRAP = 0;

  // ellipse.determinant: U7F14
  localparam int ELLIPSE_DETERMINANT_W = 21; localparam int ELLIPSE_DETERMINANT_F = 14; localparam int ELLIPSE_DETERMINANT_S = 0; localparam int ELLIPSE_DETERMINANT_ROUND = 1; localparam int ELLIPSE_DETERMINANT_WRAP = 0;

  // ellipse.edge: I17F0
  localparam int ELLIPSE_EDGE_W = 17; localparam int ELLIPSE_EDGE_F = 0; localparam int ELLIPSE_EDGE_S = 1; localparam int ELLIPSE_EDGE_ROUND = 0; localparam int ELLIPSE_EDGE_WRAP = 0;

  // ellipse.extent: U12F2
  localparam int ELLIPSE_EXTENT_W = 14; localparam int ELLIPSE_EXTENT_F = 2; localparam int ELLIPSE_EXTENT_S = 0; localparam int ELLIPSE_EXTENT_ROUND = 1; localparam int ELLIPSE_EXTENT_WRAP = 0;

  // ellipse.extent_root.correction: U1F9
  localparam int ELLIPSE_EXTENT_ROOT_CORRECTION_W = 10; localparam int ELLIPSE_EXTENT_ROOT_CORRECTION_F = 9; localparam int ELLIPSE_EXTENT_ROOT_CORRECTION_S = 0; localparam int ELLIPSE_EXTENT_ROOT_CORRECTION_ROUND = 1; localparam int ELLIPSE_EXTENT_ROOT_CORRECTION_WRAP = 0;

  // ellipse.extent_root.mantissa: U2F8
  localparam int ELLIPSE_EXTENT_ROOT_MANTISSA_W = 10; localparam int ELLIPSE_EXTENT_ROOT_MANTISSA_F = 8; localparam int ELLIPSE_EXTENT_ROOT_MANTISSA_S = 0; localparam int ELLIPSE_EXTENT_ROOT_MANTISSA_ROUND = 0; localparam int ELLIPSE_EXTENT_ROOT_MANTISSA_WRAP = 0;

  // ellipse.extent_root.result: U1F9
  localparam int ELLIPSE_EXTENT_ROOT_RESULT_W = 10; localparam int ELLIPSE_EXTENT_ROOT_RESULT_F = 9; localparam int ELLIPSE_EXTENT_ROOT_RESULT_S = 0; localparam int ELLIPSE_EXTENT_ROOT_RESULT_ROUND = 1; localparam int ELLIPSE_EXTENT_ROOT_RESULT_WRAP = 0;

  // ellipse.extent_root.square: U1F9
  localparam int ELLIPSE_EXTENT_ROOT_SQUARE_W = 10; localparam int ELLIPSE_EXTENT_ROOT_SQUARE_F = 9; localparam int ELLIPSE_EXTENT_ROOT_SQUARE_S = 0; localparam int ELLIPSE_EXTENT_ROOT_SQUARE_ROUND = 1; localparam int ELLIPSE_EXTENT_ROOT_SQUARE_WRAP = 0;

  // ellipse.facing: I3F7
  localparam int ELLIPSE_FACING_W = 10; localparam int ELLIPSE_FACING_F = 7; localparam int ELLIPSE_FACING_S = 1; localparam int ELLIPSE_FACING_ROUND = 1; localparam int ELLIPSE_FACING_WRAP = 0;

  // ellipse.inverse: U1F8
  localparam int ELLIPSE_INVERSE_W = 9; localparam int ELLIPSE_INVERSE_F = 8; localparam int ELLIPSE_INVERSE_S = 0; localparam int ELLIPSE_INVERSE_ROUND = 1; localparam int ELLIPSE_INVERSE_WRAP = 0;

  // ellipse.inverse_focal: U1F8
  localparam int ELLIPSE_INVERSE_FOCAL_W = 9; localparam int ELLIPSE_INVERSE_FOCAL_F = 8; localparam int ELLIPSE_INVERSE_FOCAL_S = 0; localparam int ELLIPSE_INVERSE_FOCAL_ROUND = 1; localparam int ELLIPSE_INVERSE_FOCAL_WRAP = 0;

  // ellipse.inverse_two_pi: U-2F10
  localparam int ELLIPSE_INVERSE_TWO_PI_W = 8; localparam int ELLIPSE_INVERSE_TWO_PI_F = 10; localparam int ELLIPSE_INVERSE_TWO_PI_S = 0; localparam int ELLIPSE_INVERSE_TWO_PI_ROUND = 1; localparam int ELLIPSE_INVERSE_TWO_PI_WRAP = 0;

  // ellipse.low_pass: U3F8
  localparam int ELLIPSE_LOW_PASS_W = 11; localparam int ELLIPSE_LOW_PASS_F = 8; localparam int ELLIPSE_LOW_PASS_S = 0; localparam int ELLIPSE_LOW_PASS_ROUND = 1; localparam int ELLIPSE_LOW_PASS_WRAP = 0;

  // ellipse.normal: I2F7
  localparam int ELLIPSE_NORMAL_W = 9; localparam int ELLIPSE_NORMAL_F = 7; localparam int ELLIPSE_NORMAL_S = 1; localparam int ELLIPSE_NORMAL_ROUND = 1; localparam int ELLIPSE_NORMAL_WRAP = 0;

  // ellipse.root.correction: U1F9
  localparam int ELLIPSE_ROOT_CORRECTION_W = 10; localparam int ELLIPSE_ROOT_CORRECTION_F = 9; localparam int ELLIPSE_ROOT_CORRECTION_S = 0; localparam int ELLIPSE_ROOT_CORRECTION_ROUND = 1; localparam int ELLIPSE_ROOT_CORRECTION_WRAP = 0;

  // ellipse.root.mantissa: U2F8
  localparam int ELLIPSE_ROOT_MANTISSA_W = 10; localparam int ELLIPSE_ROOT_MANTISSA_F = 8; localparam int ELLIPSE_ROOT_MANTISSA_S = 0; localparam int ELLIPSE_ROOT_MANTISSA_ROUND = 0; localparam int ELLIPSE_ROOT_MANTISSA_WRAP = 0;

  // ellipse.root.result: U1F9
  localparam int ELLIPSE_ROOT_RESULT_W = 10; localparam int ELLIPSE_ROOT_RESULT_F = 9; localparam int ELLIPSE_ROOT_RESULT_S = 0; localparam int ELLIPSE_ROOT_RESULT_ROUND = 1; localparam int ELLIPSE_ROOT_RESULT_WRAP = 0;

  // ellipse.root.square: U1F9
  localparam int ELLIPSE_ROOT_SQUARE_W = 10; localparam int ELLIPSE_ROOT_SQUARE_F = 9; localparam int ELLIPSE_ROOT_SQUARE_S = 0; localparam int ELLIPSE_ROOT_SQUARE_ROUND = 1; localparam int ELLIPSE_ROOT_SQUARE_WRAP = 0;

  // ellipse.root_cutoff: U3F6
  localparam int ELLIPSE_ROOT_CUTOFF_W = 9; localparam int ELLIPSE_ROOT_CUTOFF_F = 6; localparam int ELLIPSE_ROOT_CUTOFF_S = 0; localparam int ELLIPSE_ROOT_CUTOFF_ROUND = 1; localparam int ELLIPSE_ROOT_CUTOFF_WRAP = 0;

  // ellipse.scaled_radius: U1F8
  localparam int ELLIPSE_SCALED_RADIUS_W = 9; localparam int ELLIPSE_SCALED_RADIUS_F = 8; localparam int ELLIPSE_SCALED_RADIUS_S = 0; localparam int ELLIPSE_SCALED_RADIUS_ROUND = 0; localparam int ELLIPSE_SCALED_RADIUS_WRAP = 0;

  // ellipse.shape: I4F6
  localparam int ELLIPSE_SHAPE_W = 10; localparam int ELLIPSE_SHAPE_F = 6; localparam int ELLIPSE_SHAPE_S = 1; localparam int ELLIPSE_SHAPE_ROUND = 1; localparam int ELLIPSE_SHAPE_WRAP = 0;

  // ellipse.size: U0F8
  localparam int ELLIPSE_SIZE_W = 8; localparam int ELLIPSE_SIZE_F = 8; localparam int ELLIPSE_SIZE_S = 0; localparam int ELLIPSE_SIZE_ROUND = 1; localparam int ELLIPSE_SIZE_WRAP = 0;

  // ellipse.size_squared: U0F9
  localparam int ELLIPSE_SIZE_SQUARED_W = 9; localparam int ELLIPSE_SIZE_SQUARED_F = 9; localparam int ELLIPSE_SIZE_SQUARED_S = 0; localparam int ELLIPSE_SIZE_SQUARED_ROUND = 1; localparam int ELLIPSE_SIZE_SQUARED_WRAP = 0;

  // ellipse.slope_reciprocal.correction: U1F9
  localparam int ELLIPSE_SLOPE_RECIPROCAL_CORRECTION_W = 10; localparam int ELLIPSE_SLOPE_RECIPROCAL_CORRECTION_F = 9; localparam int ELLIPSE_SLOPE_RECIPROCAL_CORRECTION_S = 0; localparam int ELLIPSE_SLOPE_RECIPROCAL_CORRECTION_ROUND = 1; localparam int ELLIPSE_SLOPE_RECIPROCAL_CORRECTION_WRAP = 0;

  // ellipse.slope_reciprocal.mantissa: U1F9
  localparam int ELLIPSE_SLOPE_RECIPROCAL_MANTISSA_W = 10; localparam int ELLIPSE_SLOPE_RECIPROCAL_MANTISSA_F = 9; localparam int ELLIPSE_SLOPE_RECIPROCAL_MANTISSA_S = 0; localparam int ELLIPSE_SLOPE_RECIPROCAL_MANTISSA_ROUND = 0; localparam int ELLIPSE_SLOPE_RECIPROCAL_MANTISSA_WRAP = 0;

  // ellipse.slope_reciprocal.result: U1F9
  localparam int ELLIPSE_SLOPE_RECIPROCAL_RESULT_W = 10; localparam int ELLIPSE_SLOPE_RECIPROCAL_RESULT_F = 9; localparam int ELLIPSE_SLOPE_RECIPROCAL_RESULT_S = 0; localparam int ELLIPSE_SLOPE_RECIPROCAL_RESULT_ROUND = 1; localparam int ELLIPSE_SLOPE_RECIPROCAL_RESULT_WRAP = 0;

  // ellipse.tilt: I3F7
  localparam int ELLIPSE_TILT_W = 10; localparam int ELLIPSE_TILT_F = 7; localparam int ELLIPSE_TILT_S = 1; localparam int ELLIPSE_TILT_ROUND = 1; localparam int ELLIPSE_TILT_WRAP = 0;

  // ellipse.variance: U4F6
  localparam int ELLIPSE_VARIANCE_W = 10; localparam int ELLIPSE_VARIANCE_F = 6; localparam int ELLIPSE_VARIANCE_S = 0; localparam int ELLIPSE_VARIANCE_ROUND = 1; localparam int ELLIPSE_VARIANCE_WRAP = 0;

  // ellipse.variance_cross: I4F6
  localparam int ELLIPSE_VARIANCE_CROSS_W = 10; localparam int ELLIPSE_VARIANCE_CROSS_F = 6; localparam int ELLIPSE_VARIANCE_CROSS_S = 1; localparam int ELLIPSE_VARIANCE_CROSS_ROUND = 1; localparam int ELLIPSE_VARIANCE_CROSS_WRAP = 0;

  // ellipse.visibility: U1F8
  localparam int ELLIPSE_VISIBILITY_W = 9; localparam int ELLIPSE_VISIBILITY_F = 8; localparam int ELLIPSE_VISIBILITY_S = 0; localparam int ELLIPSE_VISIBILITY_ROUND = 1; localparam int ELLIPSE_VISIBILITY_WRAP = 0;

  // fragment.colour_sum: U3F8
  localparam int FRAGMENT_COLOUR_SUM_W = 11; localparam int FRAGMENT_COLOUR_SUM_F = 8; localparam int FRAGMENT_COLOUR_SUM_S = 0; localparam int FRAGMENT_COLOUR_SUM_ROUND = 1; localparam int FRAGMENT_COLOUR_SUM_WRAP = 0;

  // fragment.depth: U1F10
  localparam int FRAGMENT_DEPTH_W = 11; localparam int FRAGMENT_DEPTH_F = 10; localparam int FRAGMENT_DEPTH_S = 0; localparam int FRAGMENT_DEPTH_ROUND = 1; localparam int FRAGMENT_DEPTH_WRAP = 0;

  // fragment.normal: I2F6
  localparam int FRAGMENT_NORMAL_W = 8; localparam int FRAGMENT_NORMAL_F = 6; localparam int FRAGMENT_NORMAL_S = 1; localparam int FRAGMENT_NORMAL_ROUND = 1; localparam int FRAGMENT_NORMAL_WRAP = 0;

  // fragment.normal_sum: I4F8
  localparam int FRAGMENT_NORMAL_SUM_W = 12; localparam int FRAGMENT_NORMAL_SUM_F = 8; localparam int FRAGMENT_NORMAL_SUM_S = 1; localparam int FRAGMENT_NORMAL_SUM_ROUND = 1; localparam int FRAGMENT_NORMAL_SUM_WRAP = 0;

  // fragment.opacity_sum: U3F8
  localparam int FRAGMENT_OPACITY_SUM_W = 11; localparam int FRAGMENT_OPACITY_SUM_F = 8; localparam int FRAGMENT_OPACITY_SUM_S = 0; localparam int FRAGMENT_OPACITY_SUM_ROUND = 1; localparam int FRAGMENT_OPACITY_SUM_WRAP = 0;

  // fragment.opaque: U1F10
  localparam int FRAGMENT_OPAQUE_W = 11; localparam int FRAGMENT_OPAQUE_F = 10; localparam int FRAGMENT_OPAQUE_S = 0; localparam int FRAGMENT_OPAQUE_ROUND = 1; localparam int FRAGMENT_OPAQUE_WRAP = 0;

  // fragment.weight_sum: U3F8
  localparam int FRAGMENT_WEIGHT_SUM_W = 11; localparam int FRAGMENT_WEIGHT_SUM_F = 8; localparam int FRAGMENT_WEIGHT_SUM_S = 0; localparam int FRAGMENT_WEIGHT_SUM_ROUND = 1; localparam int FRAGMENT_WEIGHT_SUM_WRAP = 0;

  // gauss.falloff: U1F8
  localparam int GAUSS_FALLOFF_W = 9; localparam int GAUSS_FALLOFF_F = 8; localparam int GAUSS_FALLOFF_S = 0; localparam int GAUSS_FALLOFF_ROUND = 1; localparam int GAUSS_FALLOFF_WRAP = 0;

  // gauss.radial_index: U2F6
  localparam int GAUSS_RADIAL_INDEX_W = 8; localparam int GAUSS_RADIAL_INDEX_F = 6; localparam int GAUSS_RADIAL_INDEX_S = 0; localparam int GAUSS_RADIAL_INDEX_ROUND = 1; localparam int GAUSS_RADIAL_INDEX_WRAP = 0;

  // gauss.weight: U-2F10
  localparam int GAUSS_WEIGHT_W = 8; localparam int GAUSS_WEIGHT_F = 10; localparam int GAUSS_WEIGHT_S = 0; localparam int GAUSS_WEIGHT_ROUND = 1; localparam int GAUSS_WEIGHT_WRAP = 0;

  // project.camera: I2F9
  localparam int PROJECT_CAMERA_W = 11; localparam int PROJECT_CAMERA_F = 9; localparam int PROJECT_CAMERA_S = 1; localparam int PROJECT_CAMERA_ROUND = 1; localparam int PROJECT_CAMERA_WRAP = 0;

  // project.depth: U1F12
  localparam int PROJECT_DEPTH_W = 13; localparam int PROJECT_DEPTH_F = 12; localparam int PROJECT_DEPTH_S = 0; localparam int PROJECT_DEPTH_ROUND = 1; localparam int PROJECT_DEPTH_WRAP = 0;

  // project.eye: I3F11
  localparam int PROJECT_EYE_W = 14; localparam int PROJECT_EYE_F = 11; localparam int PROJECT_EYE_S = 1; localparam int PROJECT_EYE_ROUND = 1; localparam int PROJECT_EYE_WRAP = 0;

  // project.focal: U11F2
  localparam int PROJECT_FOCAL_W = 13; localparam int PROJECT_FOCAL_F = 2; localparam int PROJECT_FOCAL_S = 0; localparam int PROJECT_FOCAL_ROUND = 1; localparam int PROJECT_FOCAL_WRAP = 0;

  // project.pixel: I12F3
  localparam int PROJECT_PIXEL_W = 15; localparam int PROJECT_PIXEL_F = 3; localparam int PROJECT_PIXEL_S = 1; localparam int PROJECT_PIXEL_ROUND = 1; localparam int PROJECT_PIXEL_WRAP = 0;

  // project.reciprocal.correction: U1F9
  localparam int PROJECT_RECIPROCAL_CORRECTION_W = 10; localparam int PROJECT_RECIPROCAL_CORRECTION_F = 9; localparam int PROJECT_RECIPROCAL_CORRECTION_S = 0; localparam int PROJECT_RECIPROCAL_CORRECTION_ROUND = 1; localparam int PROJECT_RECIPROCAL_CORRECTION_WRAP = 0;

  // project.reciprocal.mantissa: U1F9
  localparam int PROJECT_RECIPROCAL_MANTISSA_W = 10; localparam int PROJECT_RECIPROCAL_MANTISSA_F = 9; localparam int PROJECT_RECIPROCAL_MANTISSA_S = 0; localparam int PROJECT_RECIPROCAL_MANTISSA_ROUND = 0; localparam int PROJECT_RECIPROCAL_MANTISSA_WRAP = 0;

  // project.reciprocal.result: U1F9
  localparam int PROJECT_RECIPROCAL_RESULT_W = 10; localparam int PROJECT_RECIPROCAL_RESULT_F = 9; localparam int PROJECT_RECIPROCAL_RESULT_S = 0; localparam int PROJECT_RECIPROCAL_RESULT_ROUND = 1; localparam int PROJECT_RECIPROCAL_RESULT_WRAP = 0;

  // project.relative: I1F9
  localparam int PROJECT_RELATIVE_W = 10; localparam int PROJECT_RELATIVE_F = 9; localparam int PROJECT_RELATIVE_S = 1; localparam int PROJECT_RELATIVE_ROUND = 0; localparam int PROJECT_RELATIVE_WRAP = 0;

  // project.rotation: I2F8
  localparam int PROJECT_ROTATION_W = 10; localparam int PROJECT_ROTATION_F = 8; localparam int PROJECT_ROTATION_S = 1; localparam int PROJECT_ROTATION_ROUND = 1; localparam int PROJECT_ROTATION_WRAP = 0;

  // project.slope: I2F9
  localparam int PROJECT_SLOPE_W = 11; localparam int PROJECT_SLOPE_F = 9; localparam int PROJECT_SLOPE_S = 1; localparam int PROJECT_SLOPE_ROUND = 1; localparam int PROJECT_SLOPE_WRAP = 0;

  // raster.cutoff: U5F4
  localparam int RASTER_CUTOFF_W = 9; localparam int RASTER_CUTOFF_F = 4; localparam int RASTER_CUTOFF_S = 0; localparam int RASTER_CUTOFF_ROUND = 1; localparam int RASTER_CUTOFF_WRAP = 0;

  // raster.depth: I4F12
  localparam int RASTER_DEPTH_W = 16; localparam int RASTER_DEPTH_F = 12; localparam int RASTER_DEPTH_S = 1; localparam int RASTER_DEPTH_ROUND = 1; localparam int RASTER_DEPTH_WRAP = 1;

  // raster.first: I8F8
  localparam int RASTER_FIRST_W = 16; localparam int RASTER_FIRST_F = 8; localparam int RASTER_FIRST_S = 1; localparam int RASTER_FIRST_ROUND = 1; localparam int RASTER_FIRST_WRAP = 0;

  // raster.gradient: I8F5
  localparam int RASTER_GRADIENT_W = 13; localparam int RASTER_GRADIENT_F = 5; localparam int RASTER_GRADIENT_S = 1; localparam int RASTER_GRADIENT_ROUND = 1; localparam int RASTER_GRADIENT_WRAP = 0;

  // raster.offset: I10F3
  localparam int RASTER_OFFSET_W = 13; localparam int RASTER_OFFSET_F = 3; localparam int RASTER_OFFSET_S = 1; localparam int RASTER_OFFSET_ROUND = 1; localparam int RASTER_OFFSET_WRAP = 0;

  // raster.radial: I9F8
  localparam int RASTER_RADIAL_W = 17; localparam int RASTER_RADIAL_F = 8; localparam int RASTER_RADIAL_S = 1; localparam int RASTER_RADIAL_ROUND = 1; localparam int RASTER_RADIAL_WRAP = 1;

  // raster.second: I3F8
  localparam int RASTER_SECOND_W = 11; localparam int RASTER_SECOND_F = 8; localparam int RASTER_SECOND_S = 1; localparam int RASTER_SECOND_ROUND = 1; localparam int RASTER_SECOND_WRAP = 0;

  // resolve.frame: U1F8
  localparam int RESOLVE_FRAME_W = 9; localparam int RESOLVE_FRAME_F = 8; localparam int RESOLVE_FRAME_S = 0; localparam int RESOLVE_FRAME_ROUND = 1; localparam int RESOLVE_FRAME_WRAP = 0;

  // resolve.transmittance: U1F8
  localparam int RESOLVE_TRANSMITTANCE_W = 9; localparam int RESOLVE_TRANSMITTANCE_F = 8; localparam int RESOLVE_TRANSMITTANCE_S = 0; localparam int RESOLVE_TRANSMITTANCE_ROUND = 1; localparam int RESOLVE_TRANSMITTANCE_WRAP = 0;

  // shade.colour: U1F8
  localparam int SHADE_COLOUR_W = 9; localparam int SHADE_COLOUR_F = 8; localparam int SHADE_COLOUR_S = 0; localparam int SHADE_COLOUR_ROUND = 1; localparam int SHADE_COLOUR_WRAP = 0;

  // shade.cosine: I2F8
  localparam int SHADE_COSINE_W = 10; localparam int SHADE_COSINE_F = 8; localparam int SHADE_COSINE_S = 1; localparam int SHADE_COSINE_ROUND = 1; localparam int SHADE_COSINE_WRAP = 0;

  // shade.coverage: U1F8
  localparam int SHADE_COVERAGE_W = 9; localparam int SHADE_COVERAGE_F = 8; localparam int SHADE_COVERAGE_S = 0; localparam int SHADE_COVERAGE_ROUND = 1; localparam int SHADE_COVERAGE_WRAP = 0;

  // shade.highlight: U1F8
  localparam int SHADE_HIGHLIGHT_W = 9; localparam int SHADE_HIGHLIGHT_F = 8; localparam int SHADE_HIGHLIGHT_S = 0; localparam int SHADE_HIGHLIGHT_ROUND = 1; localparam int SHADE_HIGHLIGHT_WRAP = 0;

  // shade.inverse_threshold: U1F8
  localparam int SHADE_INVERSE_THRESHOLD_W = 9; localparam int SHADE_INVERSE_THRESHOLD_F = 8; localparam int SHADE_INVERSE_THRESHOLD_S = 0; localparam int SHADE_INVERSE_THRESHOLD_ROUND = 1; localparam int SHADE_INVERSE_THRESHOLD_WRAP = 0;

  // shade.irradiance: U3F6
  localparam int SHADE_IRRADIANCE_W = 9; localparam int SHADE_IRRADIANCE_F = 6; localparam int SHADE_IRRADIANCE_S = 0; localparam int SHADE_IRRADIANCE_ROUND = 1; localparam int SHADE_IRRADIANCE_WRAP = 0;

  // shade.light: I2F8
  localparam int SHADE_LIGHT_W = 10; localparam int SHADE_LIGHT_F = 8; localparam int SHADE_LIGHT_S = 1; localparam int SHADE_LIGHT_ROUND = 1; localparam int SHADE_LIGHT_WRAP = 0;

  // shade.normal: I2F8
  localparam int SHADE_NORMAL_W = 10; localparam int SHADE_NORMAL_F = 8; localparam int SHADE_NORMAL_S = 1; localparam int SHADE_NORMAL_ROUND = 1; localparam int SHADE_NORMAL_WRAP = 0;

  // shade.normal_share: I2F8
  localparam int SHADE_NORMAL_SHARE_W = 10; localparam int SHADE_NORMAL_SHARE_F = 8; localparam int SHADE_NORMAL_SHARE_S = 1; localparam int SHADE_NORMAL_SHARE_ROUND = 1; localparam int SHADE_NORMAL_SHARE_WRAP = 0;

  // shade.opacity: U1F8
  localparam int SHADE_OPACITY_W = 9; localparam int SHADE_OPACITY_F = 8; localparam int SHADE_OPACITY_S = 0; localparam int SHADE_OPACITY_ROUND = 1; localparam int SHADE_OPACITY_WRAP = 0;

  // shade.premultiplied: U1F8
  localparam int SHADE_PREMULTIPLIED_W = 9; localparam int SHADE_PREMULTIPLIED_F = 8; localparam int SHADE_PREMULTIPLIED_S = 0; localparam int SHADE_PREMULTIPLIED_ROUND = 1; localparam int SHADE_PREMULTIPLIED_WRAP = 0;

  // shade.reciprocal.correction: U1F8
  localparam int SHADE_RECIPROCAL_CORRECTION_W = 9; localparam int SHADE_RECIPROCAL_CORRECTION_F = 8; localparam int SHADE_RECIPROCAL_CORRECTION_S = 0; localparam int SHADE_RECIPROCAL_CORRECTION_ROUND = 1; localparam int SHADE_RECIPROCAL_CORRECTION_WRAP = 0;

  // shade.reciprocal.mantissa: U1F8
  localparam int SHADE_RECIPROCAL_MANTISSA_W = 9; localparam int SHADE_RECIPROCAL_MANTISSA_F = 8; localparam int SHADE_RECIPROCAL_MANTISSA_S = 0; localparam int SHADE_RECIPROCAL_MANTISSA_ROUND = 0; localparam int SHADE_RECIPROCAL_MANTISSA_WRAP = 0;

  // shade.reciprocal.result: U1F8
  localparam int SHADE_RECIPROCAL_RESULT_W = 9; localparam int SHADE_RECIPROCAL_RESULT_F = 8; localparam int SHADE_RECIPROCAL_RESULT_S = 0; localparam int SHADE_RECIPROCAL_RESULT_ROUND = 1; localparam int SHADE_RECIPROCAL_RESULT_WRAP = 0;

  // shade.reflectance: U3F6
  localparam int SHADE_REFLECTANCE_W = 9; localparam int SHADE_REFLECTANCE_F = 6; localparam int SHADE_REFLECTANCE_S = 0; localparam int SHADE_REFLECTANCE_ROUND = 1; localparam int SHADE_REFLECTANCE_WRAP = 0;

  // shade.rgb: U1F8
  localparam int SHADE_RGB_W = 9; localparam int SHADE_RGB_F = 8; localparam int SHADE_RGB_S = 0; localparam int SHADE_RGB_ROUND = 1; localparam int SHADE_RGB_WRAP = 0;

  // shade.root.correction: U1F8
  localparam int SHADE_ROOT_CORRECTION_W = 9; localparam int SHADE_ROOT_CORRECTION_F = 8; localparam int SHADE_ROOT_CORRECTION_S = 0; localparam int SHADE_ROOT_CORRECTION_ROUND = 1; localparam int SHADE_ROOT_CORRECTION_WRAP = 0;

  // shade.root.mantissa: U2F7
  localparam int SHADE_ROOT_MANTISSA_W = 9; localparam int SHADE_ROOT_MANTISSA_F = 7; localparam int SHADE_ROOT_MANTISSA_S = 0; localparam int SHADE_ROOT_MANTISSA_ROUND = 0; localparam int SHADE_ROOT_MANTISSA_WRAP = 0;

  // shade.root.result: U1F8
  localparam int SHADE_ROOT_RESULT_W = 9; localparam int SHADE_ROOT_RESULT_F = 8; localparam int SHADE_ROOT_RESULT_S = 0; localparam int SHADE_ROOT_RESULT_ROUND = 1; localparam int SHADE_ROOT_RESULT_WRAP = 0;

  // shade.root.square: U1F8
  localparam int SHADE_ROOT_SQUARE_W = 9; localparam int SHADE_ROOT_SQUARE_F = 8; localparam int SHADE_ROOT_SQUARE_S = 0; localparam int SHADE_ROOT_SQUARE_ROUND = 1; localparam int SHADE_ROOT_SQUARE_WRAP = 0;

  // shade.share: U2F8
  localparam int SHADE_SHARE_W = 10; localparam int SHADE_SHARE_F = 8; localparam int SHADE_SHARE_S = 0; localparam int SHADE_SHARE_ROUND = 1; localparam int SHADE_SHARE_WRAP = 0;

  // splat.normal: I2F6
  localparam int SPLAT_NORMAL_W = 8; localparam int SPLAT_NORMAL_F = 6; localparam int SPLAT_NORMAL_S = 1; localparam int SPLAT_NORMAL_ROUND = 1; localparam int SPLAT_NORMAL_WRAP = 0;

  // splat.opacity: U1F7
  localparam int SPLAT_OPACITY_W = 8; localparam int SPLAT_OPACITY_F = 7; localparam int SPLAT_OPACITY_S = 0; localparam int SPLAT_OPACITY_ROUND = 1; localparam int SPLAT_OPACITY_WRAP = 0;

  // splat.position: I1F11
  localparam int SPLAT_POSITION_W = 12; localparam int SPLAT_POSITION_F = 11; localparam int SPLAT_POSITION_S = 1; localparam int SPLAT_POSITION_ROUND = 1; localparam int SPLAT_POSITION_WRAP = 0;

  // splat.radius: U-3F14
  localparam int SPLAT_RADIUS_W = 11; localparam int SPLAT_RADIUS_F = 14; localparam int SPLAT_RADIUS_S = 0; localparam int SPLAT_RADIUS_ROUND = 1; localparam int SPLAT_RADIUS_WRAP = 0;

  // splat.rgb: U1F7
  localparam int SPLAT_RGB_W = 8; localparam int SPLAT_RGB_F = 7; localparam int SPLAT_RGB_S = 0; localparam int SPLAT_RGB_ROUND = 1; localparam int SPLAT_RGB_WRAP = 0;

  // Tables, rules and timing.
  localparam int PROJECT_RECIPROCAL_TABLE_BITS = 6;
  localparam int PROJECT_RECIPROCAL_NEWTON_STEPS = 0;
  localparam int PROJECT_RECIPROCAL_BITS = 9;
  localparam int ELLIPSE_SLOPE_RECIPROCAL_TABLE_BITS = 6;
  localparam int ELLIPSE_SLOPE_RECIPROCAL_NEWTON_STEPS = 0;
  localparam int ELLIPSE_SLOPE_RECIPROCAL_BITS = 9;
  localparam int SHADE_RECIPROCAL_TABLE_BITS = 6;
  localparam int SHADE_RECIPROCAL_NEWTON_STEPS = 0;
  localparam int SHADE_RECIPROCAL_BITS = 8;
  localparam int ELLIPSE_ROOT_TABLE_BITS = 6;
  localparam int ELLIPSE_ROOT_NEWTON_STEPS = 0;
  localparam int ELLIPSE_ROOT_BITS = 9;
  localparam int ELLIPSE_EXTENT_ROOT_TABLE_BITS = 6;
  localparam int ELLIPSE_EXTENT_ROOT_NEWTON_STEPS = 0;
  localparam int ELLIPSE_EXTENT_ROOT_BITS = 9;
  localparam int SHADE_ROOT_TABLE_BITS = 6;
  localparam int SHADE_ROOT_NEWTON_STEPS = 0;
  localparam int SHADE_ROOT_BITS = 8;
  localparam int GAUSS_TABLE_BITS = 5;
  localparam int GAUSS_TABLE_LINEAR = 0;
  localparam int SHADE_HIGHLIGHT_TABLE_BITS = 6;
  localparam int SHADE_HIGHLIGHT_TABLE_LINEAR = 0;
  localparam int VIEW_FOCAL_X_LSB = 152;
  localparam int VIEW_INVERSE_FOCAL_X_LSB = 143;
  localparam int VIEW_INVERSE_FOCAL_X_PLACES_LSB = 135;
  localparam int VIEW_FOCAL_Y_LSB = 152;
  localparam int VIEW_INVERSE_FOCAL_Y_LSB = 143;
  localparam int VIEW_INVERSE_FOCAL_Y_PLACES_LSB = 135;
  localparam int VIEW_ASPECT_W = 0;
  localparam int VIEW_ASPECT_F = 0;
  localparam int VIEW_ASPECT_YY_LSB = 0;
  localparam int PROJECT_OPACITY_W = 0;
  localparam int PROJECT_LEAST_OPACITY_LSB = 0;
  localparam int ELLIPSE_REACH_BITS = 0;
  localparam int RASTER_DIFFERENCED = 0;
  localparam int RASTER_EXACT_DEPTH_F = 12;
  localparam int ELLIPSE_INVERSE_TWO_PI_WORD = 163;
  localparam int FRAGMENT_LAYERS = 3;
  localparam int FRAGMENT_MERGE = 1;
  localparam int FRAGMENT_EVICT_HIDDEN = 1;
  localparam int FRAGMENT_TURN_NORMALS = 1;
  localparam int FRAGMENT_NEAREST_DEPTH = 0;
  localparam int FRAGMENT_OPAQUE_LIMIT = 1022;
  localparam int FRAGMENT_OPAQUE_SHADED = 256;
  localparam int LIGHTS = 1;
  localparam int MATERIALS = 1;
  localparam int PROJECT_LATENCY = 1;
  localparam int PROJECT_INTERVAL = 1;
  localparam int PROJECT_ROOM = 5;
  localparam int ELLIPSE_LATENCY = 2;
  localparam int ELLIPSE_INTERVAL = 1;
  localparam int ELLIPSE_ROOM = 18;
  localparam int RASTER_LATENCY = 1;
  localparam int RASTER_INTERVAL = 1;
  localparam int RASTER_ROOM = 17;
  localparam int GAUSS_LATENCY = 1;
  localparam int GAUSS_INTERVAL = 1;
  localparam int GAUSS_ROOM = 5;
  localparam int FRAGMENT_LATENCY = 1;
  localparam int FRAGMENT_INTERVAL = 1;
  localparam int FRAGMENT_ROOM = 2;
  localparam int SHADE_LATENCY = 2;
  localparam int SHADE_INTERVAL = 1;
  localparam int SHADE_ROOM = 3;
  localparam int RESOLVE_LATENCY = 1;
  localparam int RESOLVE_INTERVAL = 1;
  localparam int RESOLVE_ROOM = 2;
  localparam int FRAGMENT_HAZARD = 1;
  localparam int FRAGMENT_MERGE_CYCLES = 1;

  // Codes of fragment.out.outcome.
  typedef enum logic [2:0] {
    OUTCOME_ACCUMULATED = 3'd0,
    OUTCOME_INSERTED = 3'd1,
    OUTCOME_MERGED = 3'd2,
    OUTCOME_EVICTED = 3'd3,
    OUTCOME_REPLACED = 3'd4,
    OUTCOME_DROPPED = 3'd5
  } outcome_t;

  // Codes of FRAGMENT_MERGE.
  typedef enum int {
    MERGE_NEAREST_PAIR = 0,
    MERGE_FARTHEST_PAIR = 1,
    MERGE_REPLACE = 2
  } merge_t;

  // Codes of _ROUND.
  typedef enum int {
    ROUND_TRUNCATE = 0,
    ROUND_NEAREST = 1,
    ROUND_NEAREST_EVEN = 2
  } round_t;

  // Codes of _WRAP.
  typedef enum int {
    OVERFLOW_SATURATE = 0,
    OVERFLOW_WRAP = 1
  } overflow_t;

  // frame
  localparam int FRAME_W = 362;
  localparam int FRAME_WIDTH_LSB = 347; localparam int FRAME_WIDTH_W = 15;
  localparam int FRAME_HEIGHT_LSB = 332; localparam int FRAME_HEIGHT_W = 15;
  localparam int FRAME_ROTATION_00_LSB = 322; localparam int FRAME_ROTATION_00_W = 10;
  localparam int FRAME_ROTATION_01_LSB = 312; localparam int FRAME_ROTATION_01_W = 10;
  localparam int FRAME_ROTATION_02_LSB = 302; localparam int FRAME_ROTATION_02_W = 10;
  localparam int FRAME_ROTATION_10_LSB = 292; localparam int FRAME_ROTATION_10_W = 10;
  localparam int FRAME_ROTATION_11_LSB = 282; localparam int FRAME_ROTATION_11_W = 10;
  localparam int FRAME_ROTATION_12_LSB = 272; localparam int FRAME_ROTATION_12_W = 10;
  localparam int FRAME_ROTATION_20_LSB = 262; localparam int FRAME_ROTATION_20_W = 10;
  localparam int FRAME_ROTATION_21_LSB = 252; localparam int FRAME_ROTATION_21_W = 10;
  localparam int FRAME_ROTATION_22_LSB = 242; localparam int FRAME_ROTATION_22_W = 10;
  localparam int FRAME_EYE_X_LSB = 228; localparam int FRAME_EYE_X_W = 14;
  localparam int FRAME_EYE_Y_LSB = 214; localparam int FRAME_EYE_Y_W = 14;
  localparam int FRAME_EYE_Z_LSB = 200; localparam int FRAME_EYE_Z_W = 14;
  localparam int FRAME_NEAR_LSB = 187; localparam int FRAME_NEAR_W = 13;
  localparam int FRAME_GUARD_X_LSB = 176; localparam int FRAME_GUARD_X_W = 11;
  localparam int FRAME_GUARD_Y_LSB = 165; localparam int FRAME_GUARD_Y_W = 11;
  localparam int FRAME_FOCAL_LSB = 152; localparam int FRAME_FOCAL_W = 13;
  localparam int FRAME_INVERSE_FOCAL_LSB = 143; localparam int FRAME_INVERSE_FOCAL_W = 9;
  localparam int FRAME_INVERSE_FOCAL_PLACES_LSB = 135; localparam int FRAME_INVERSE_FOCAL_PLACES_W = 8;
  localparam int FRAME_LOW_PASS_LSB = 124; localparam int FRAME_LOW_PASS_W = 11;
  localparam int FRAME_CUTOFF_LSB = 115; localparam int FRAME_CUTOFF_W = 9;
  localparam int FRAME_ROOT_CUTOFF_LSB = 106; localparam int FRAME_ROOT_CUTOFF_W = 9;
  localparam int FRAME_CENTRE_X_LSB = 91; localparam int FRAME_CENTRE_X_W = 15;
  localparam int FRAME_CENTRE_Y_LSB = 76; localparam int FRAME_CENTRE_Y_W = 15;
  localparam int FRAME_CULL_BACKFACES_LSB = 75; localparam int FRAME_CULL_BACKFACES_W = 1;
  localparam int FRAME_Z_THRESHOLD_LSB = 64; localparam int FRAME_Z_THRESHOLD_W = 11;
  localparam int FRAME_COVERAGE_THRESHOLD_LSB = 53; localparam int FRAME_COVERAGE_THRESHOLD_W = 11;
  localparam int FRAME_INVERSE_THRESHOLD_LSB = 44; localparam int FRAME_INVERSE_THRESHOLD_W = 9;
  localparam int FRAME_INVERSE_THRESHOLD_PLACES_LSB = 36; localparam int FRAME_INVERSE_THRESHOLD_PLACES_W = 8;
  localparam int FRAME_BACKGROUND_R_LSB = 27; localparam int FRAME_BACKGROUND_R_W = 9;
  localparam int FRAME_BACKGROUND_G_LSB = 18; localparam int FRAME_BACKGROUND_G_W = 9;
  localparam int FRAME_BACKGROUND_B_LSB = 9; localparam int FRAME_BACKGROUND_B_W = 9;
  localparam int FRAME_BACKGROUND_A_LSB = 0; localparam int FRAME_BACKGROUND_A_W = 9;

  // light
  localparam int LIGHT_W = 61;
  localparam int LIGHT_DIRECTION_X_LSB = 51; localparam int LIGHT_DIRECTION_X_W = 10;
  localparam int LIGHT_DIRECTION_Y_LSB = 41; localparam int LIGHT_DIRECTION_Y_W = 10;
  localparam int LIGHT_DIRECTION_Z_LSB = 31; localparam int LIGHT_DIRECTION_Z_W = 10;
  localparam int LIGHT_HAS_HALF_WAY_LSB = 30; localparam int LIGHT_HAS_HALF_WAY_W = 1;
  localparam int LIGHT_HALF_WAY_X_LSB = 20; localparam int LIGHT_HALF_WAY_X_W = 10;
  localparam int LIGHT_HALF_WAY_Y_LSB = 10; localparam int LIGHT_HALF_WAY_Y_W = 10;
  localparam int LIGHT_HALF_WAY_Z_LSB = 0; localparam int LIGHT_HALF_WAY_Z_W = 10;

  // material
  localparam int MATERIAL_W = 10;
  localparam int MATERIAL_UNLIT_LSB = 9; localparam int MATERIAL_UNLIT_W = 1;
  localparam int MATERIAL_AMBIENT_LSB = 0; localparam int MATERIAL_AMBIENT_W = 9;

  // reflection
  localparam int REFLECTION_W = 54;
  localparam int REFLECTION_DIFFUSE_R_LSB = 45; localparam int REFLECTION_DIFFUSE_R_W = 9;
  localparam int REFLECTION_DIFFUSE_G_LSB = 36; localparam int REFLECTION_DIFFUSE_G_W = 9;
  localparam int REFLECTION_DIFFUSE_B_LSB = 27; localparam int REFLECTION_DIFFUSE_B_W = 9;
  localparam int REFLECTION_SPECULAR_R_LSB = 18; localparam int REFLECTION_SPECULAR_R_W = 9;
  localparam int REFLECTION_SPECULAR_G_LSB = 9; localparam int REFLECTION_SPECULAR_G_W = 9;
  localparam int REFLECTION_SPECULAR_B_LSB = 0; localparam int REFLECTION_SPECULAR_B_W = 9;

  // pipeline.in
  localparam int PIPELINE_IN_W = 111;
  localparam int PIPELINE_IN_POSITION_X_LSB = 99; localparam int PIPELINE_IN_POSITION_X_W = 12;
  localparam int PIPELINE_IN_POSITION_Y_LSB = 87; localparam int PIPELINE_IN_POSITION_Y_W = 12;
  localparam int PIPELINE_IN_POSITION_Z_LSB = 75; localparam int PIPELINE_IN_POSITION_Z_W = 12;
  localparam int PIPELINE_IN_NORMAL_X_LSB = 67; localparam int PIPELINE_IN_NORMAL_X_W = 8;
  localparam int PIPELINE_IN_NORMAL_Y_LSB = 59; localparam int PIPELINE_IN_NORMAL_Y_W = 8;
  localparam int PIPELINE_IN_NORMAL_Z_LSB = 51; localparam int PIPELINE_IN_NORMAL_Z_W = 8;
  localparam int PIPELINE_IN_RADIUS_LSB = 40; localparam int PIPELINE_IN_RADIUS_W = 11;
  localparam int PIPELINE_IN_RED_LSB = 32; localparam int PIPELINE_IN_RED_W = 8;
  localparam int PIPELINE_IN_GREEN_LSB = 24; localparam int PIPELINE_IN_GREEN_W = 8;
  localparam int PIPELINE_IN_BLUE_LSB = 16; localparam int PIPELINE_IN_BLUE_W = 8;
  localparam int PIPELINE_IN_OPACITY_LSB = 8; localparam int PIPELINE_IN_OPACITY_W = 8;
  localparam int PIPELINE_IN_MATERIAL_LSB = 0; localparam int PIPELINE_IN_MATERIAL_W = 8;

  // project.in
  localparam int PROJECT_IN_W = 36;
  localparam int PROJECT_IN_POSITION_X_LSB = 24; localparam int PROJECT_IN_POSITION_X_W = 12;
  localparam int PROJECT_IN_POSITION_Y_LSB = 12; localparam int PROJECT_IN_POSITION_Y_W = 12;
  localparam int PROJECT_IN_POSITION_Z_LSB = 0; localparam int PROJECT_IN_POSITION_Z_W = 12;

  // project.out
  localparam int PROJECT_OUT_W = 104;
  localparam int PROJECT_OUT_NEAR_LSB = 103; localparam int PROJECT_OUT_NEAR_W = 1;
  localparam int PROJECT_OUT_OUTSIDE_LSB = 102; localparam int PROJECT_OUT_OUTSIDE_W = 1;
  localparam int PROJECT_OUT_FORWARD_LSB = 91; localparam int PROJECT_OUT_FORWARD_W = 11;
  localparam int PROJECT_OUT_EXPONENT_LSB = 83; localparam int PROJECT_OUT_EXPONENT_W = 8;
  localparam int PROJECT_OUT_DEPTH_LSB = 70; localparam int PROJECT_OUT_DEPTH_W = 13;
  localparam int PROJECT_OUT_INVERSE_DEPTH_LSB = 60; localparam int PROJECT_OUT_INVERSE_DEPTH_W = 10;
  localparam int PROJECT_OUT_INVERSE_DEPTH_EXPONENT_LSB = 52; localparam int PROJECT_OUT_INVERSE_DEPTH_EXPONENT_W = 8;
  localparam int PROJECT_OUT_SLOPE_X_LSB = 41; localparam int PROJECT_OUT_SLOPE_X_W = 11;
  localparam int PROJECT_OUT_SLOPE_Y_LSB = 30; localparam int PROJECT_OUT_SLOPE_Y_W = 11;
  localparam int PROJECT_OUT_PIXEL_X_LSB = 15; localparam int PROJECT_OUT_PIXEL_X_W = 15;
  localparam int PROJECT_OUT_PIXEL_Y_LSB = 0; localparam int PROJECT_OUT_PIXEL_Y_W = 15;

  // ellipse.in
  localparam int ELLIPSE_IN_W = 124;
  localparam int ELLIPSE_IN_NORMAL_X_LSB = 116; localparam int ELLIPSE_IN_NORMAL_X_W = 8;
  localparam int ELLIPSE_IN_NORMAL_Y_LSB = 108; localparam int ELLIPSE_IN_NORMAL_Y_W = 8;
  localparam int ELLIPSE_IN_NORMAL_Z_LSB = 100; localparam int ELLIPSE_IN_NORMAL_Z_W = 8;
  localparam int ELLIPSE_IN_RADIUS_LSB = 89; localparam int ELLIPSE_IN_RADIUS_W = 11;
  localparam int ELLIPSE_IN_FORWARD_LSB = 78; localparam int ELLIPSE_IN_FORWARD_W = 11;
  localparam int ELLIPSE_IN_EXPONENT_LSB = 70; localparam int ELLIPSE_IN_EXPONENT_W = 8;
  localparam int ELLIPSE_IN_INVERSE_DEPTH_LSB = 60; localparam int ELLIPSE_IN_INVERSE_DEPTH_W = 10;
  localparam int ELLIPSE_IN_INVERSE_DEPTH_EXPONENT_LSB = 52; localparam int ELLIPSE_IN_INVERSE_DEPTH_EXPONENT_W = 8;
  localparam int ELLIPSE_IN_SLOPE_X_LSB = 41; localparam int ELLIPSE_IN_SLOPE_X_W = 11;
  localparam int ELLIPSE_IN_SLOPE_Y_LSB = 30; localparam int ELLIPSE_IN_SLOPE_Y_W = 11;
  localparam int ELLIPSE_IN_PIXEL_X_LSB = 15; localparam int ELLIPSE_IN_PIXEL_X_W = 15;
  localparam int ELLIPSE_IN_PIXEL_Y_LSB = 0; localparam int ELLIPSE_IN_PIXEL_Y_W = 15;

  // ellipse.out
  localparam int ELLIPSE_OUT_W = 151;
  localparam int ELLIPSE_OUT_BACKFACE_LSB = 150; localparam int ELLIPSE_OUT_BACKFACE_W = 1;
  localparam int ELLIPSE_OUT_FAINT_LSB = 149; localparam int ELLIPSE_OUT_FAINT_W = 1;
  localparam int ELLIPSE_OUT_OUTSIDE_LSB = 148; localparam int ELLIPSE_OUT_OUTSIDE_W = 1;
  localparam int ELLIPSE_OUT_NORMAL_X_LSB = 140; localparam int ELLIPSE_OUT_NORMAL_X_W = 8;
  localparam int ELLIPSE_OUT_NORMAL_Y_LSB = 132; localparam int ELLIPSE_OUT_NORMAL_Y_W = 8;
  localparam int ELLIPSE_OUT_NORMAL_Z_LSB = 124; localparam int ELLIPSE_OUT_NORMAL_Z_W = 8;
  localparam int ELLIPSE_OUT_CONIC_XX_LSB = 114; localparam int ELLIPSE_OUT_CONIC_XX_W = 10;
  localparam int ELLIPSE_OUT_CONIC_XY_LSB = 104; localparam int ELLIPSE_OUT_CONIC_XY_W = 10;
  localparam int ELLIPSE_OUT_CONIC_YY_LSB = 94; localparam int ELLIPSE_OUT_CONIC_YY_W = 10;
  localparam int ELLIPSE_OUT_AMPLITUDE_LSB = 86; localparam int ELLIPSE_OUT_AMPLITUDE_W = 8;
  localparam int ELLIPSE_OUT_FIRST_COLUMN_LSB = 72; localparam int ELLIPSE_OUT_FIRST_COLUMN_W = 14;
  localparam int ELLIPSE_OUT_LAST_COLUMN_LSB = 58; localparam int ELLIPSE_OUT_LAST_COLUMN_W = 14;
  localparam int ELLIPSE_OUT_FIRST_ROW_LSB = 44; localparam int ELLIPSE_OUT_FIRST_ROW_W = 14;
  localparam int ELLIPSE_OUT_LAST_ROW_LSB = 30; localparam int ELLIPSE_OUT_LAST_ROW_W = 14;
  localparam int ELLIPSE_OUT_DEPTH_SLOPE_X_LSB = 19; localparam int ELLIPSE_OUT_DEPTH_SLOPE_X_W = 11;
  localparam int ELLIPSE_OUT_DEPTH_SLOPE_Y_LSB = 8; localparam int ELLIPSE_OUT_DEPTH_SLOPE_Y_W = 11;
  localparam int ELLIPSE_OUT_DEPTH_RANGE_LSB = 0; localparam int ELLIPSE_OUT_DEPTH_RANGE_W = 8;

  // raster.in
  localparam int RASTER_IN_W = 191;
  localparam int RASTER_IN_TAG_LSB = 159; localparam int RASTER_IN_TAG_W = 32;
  localparam int RASTER_IN_PIXEL_X_LSB = 144; localparam int RASTER_IN_PIXEL_X_W = 15;
  localparam int RASTER_IN_PIXEL_Y_LSB = 129; localparam int RASTER_IN_PIXEL_Y_W = 15;
  localparam int RASTER_IN_CONIC_XX_LSB = 119; localparam int RASTER_IN_CONIC_XX_W = 10;
  localparam int RASTER_IN_CONIC_XY_LSB = 109; localparam int RASTER_IN_CONIC_XY_W = 10;
  localparam int RASTER_IN_CONIC_YY_LSB = 99; localparam int RASTER_IN_CONIC_YY_W = 10;
  localparam int RASTER_IN_DEPTH_LSB = 86; localparam int RASTER_IN_DEPTH_W = 13;
  localparam int RASTER_IN_DEPTH_SLOPE_X_LSB = 75; localparam int RASTER_IN_DEPTH_SLOPE_X_W = 11;
  localparam int RASTER_IN_DEPTH_SLOPE_Y_LSB = 64; localparam int RASTER_IN_DEPTH_SLOPE_Y_W = 11;
  localparam int RASTER_IN_DEPTH_RANGE_LSB = 56; localparam int RASTER_IN_DEPTH_RANGE_W = 8;
  localparam int RASTER_IN_FIRST_COLUMN_LSB = 42; localparam int RASTER_IN_FIRST_COLUMN_W = 14;
  localparam int RASTER_IN_LAST_COLUMN_LSB = 28; localparam int RASTER_IN_LAST_COLUMN_W = 14;
  localparam int RASTER_IN_FIRST_ROW_LSB = 14; localparam int RASTER_IN_FIRST_ROW_W = 14;
  localparam int RASTER_IN_LAST_ROW_LSB = 0; localparam int RASTER_IN_LAST_ROW_W = 14;

  // raster.out
  localparam int RASTER_OUT_W = 94;
  localparam int RASTER_OUT_TAG_LSB = 62; localparam int RASTER_OUT_TAG_W = 32;
  localparam int RASTER_OUT_X_LSB = 48; localparam int RASTER_OUT_X_W = 14;
  localparam int RASTER_OUT_Y_LSB = 34; localparam int RASTER_OUT_Y_W = 14;
  localparam int RASTER_OUT_RADIAL_LSB = 17; localparam int RASTER_OUT_RADIAL_W = 17;
  localparam int RASTER_OUT_DEPTH_LSB = 0; localparam int RASTER_OUT_DEPTH_W = 17;

  // gauss.in
  localparam int GAUSS_IN_W = 25;
  localparam int GAUSS_IN_RADIAL_LSB = 8; localparam int GAUSS_IN_RADIAL_W = 17;
  localparam int GAUSS_IN_AMPLITUDE_LSB = 0; localparam int GAUSS_IN_AMPLITUDE_W = 8;

  // gauss.out
  localparam int GAUSS_OUT_W = 8;
  localparam int GAUSS_OUT_WEIGHT_LSB = 0; localparam int GAUSS_OUT_WEIGHT_W = 8;

  // fragment.in
  localparam int FRAGMENT_IN_W = 117;
  localparam int FRAGMENT_IN_X_LSB = 103; localparam int FRAGMENT_IN_X_W = 14;
  localparam int FRAGMENT_IN_Y_LSB = 89; localparam int FRAGMENT_IN_Y_W = 14;
  localparam int FRAGMENT_IN_WEIGHT_LSB = 81; localparam int FRAGMENT_IN_WEIGHT_W = 8;
  localparam int FRAGMENT_IN_DEPTH_LSB = 64; localparam int FRAGMENT_IN_DEPTH_W = 17;
  localparam int FRAGMENT_IN_RED_LSB = 56; localparam int FRAGMENT_IN_RED_W = 8;
  localparam int FRAGMENT_IN_GREEN_LSB = 48; localparam int FRAGMENT_IN_GREEN_W = 8;
  localparam int FRAGMENT_IN_BLUE_LSB = 40; localparam int FRAGMENT_IN_BLUE_W = 8;
  localparam int FRAGMENT_IN_OPACITY_LSB = 32; localparam int FRAGMENT_IN_OPACITY_W = 8;
  localparam int FRAGMENT_IN_NORMAL_X_LSB = 24; localparam int FRAGMENT_IN_NORMAL_X_W = 8;
  localparam int FRAGMENT_IN_NORMAL_Y_LSB = 16; localparam int FRAGMENT_IN_NORMAL_Y_W = 8;
  localparam int FRAGMENT_IN_NORMAL_Z_LSB = 8; localparam int FRAGMENT_IN_NORMAL_Z_W = 8;
  localparam int FRAGMENT_IN_MATERIAL_LSB = 0; localparam int FRAGMENT_IN_MATERIAL_W = 8;

  // fragment.out
  localparam int FRAGMENT_OUT_W = 35;
  localparam int FRAGMENT_OUT_X_LSB = 21; localparam int FRAGMENT_OUT_X_W = 14;
  localparam int FRAGMENT_OUT_Y_LSB = 7; localparam int FRAGMENT_OUT_Y_W = 14;
  localparam int FRAGMENT_OUT_OUTCOME_LSB = 4; localparam int FRAGMENT_OUT_OUTCOME_W = 3;
  localparam int FRAGMENT_OUT_SLOT_LSB = 0; localparam int FRAGMENT_OUT_SLOT_W = 4;

  // fragment.request
  localparam int FRAGMENT_REQUEST_W = 99;
  localparam int FRAGMENT_REQUEST_WEIGHT_LSB = 88; localparam int FRAGMENT_REQUEST_WEIGHT_W = 11;
  localparam int FRAGMENT_REQUEST_COLOUR_R_LSB = 77; localparam int FRAGMENT_REQUEST_COLOUR_R_W = 11;
  localparam int FRAGMENT_REQUEST_COLOUR_G_LSB = 66; localparam int FRAGMENT_REQUEST_COLOUR_G_W = 11;
  localparam int FRAGMENT_REQUEST_COLOUR_B_LSB = 55; localparam int FRAGMENT_REQUEST_COLOUR_B_W = 11;
  localparam int FRAGMENT_REQUEST_OPACITY_LSB = 44; localparam int FRAGMENT_REQUEST_OPACITY_W = 11;
  localparam int FRAGMENT_REQUEST_NORMAL_X_LSB = 32; localparam int FRAGMENT_REQUEST_NORMAL_X_W = 12;
  localparam int FRAGMENT_REQUEST_NORMAL_Y_LSB = 20; localparam int FRAGMENT_REQUEST_NORMAL_Y_W = 12;
  localparam int FRAGMENT_REQUEST_NORMAL_Z_LSB = 8; localparam int FRAGMENT_REQUEST_NORMAL_Z_W = 12;
  localparam int FRAGMENT_REQUEST_MATERIAL_LSB = 0; localparam int FRAGMENT_REQUEST_MATERIAL_W = 8;

  // fragment.answer
  localparam int FRAGMENT_ANSWER_W = 36;
  localparam int FRAGMENT_ANSWER_COLOUR_R_LSB = 27; localparam int FRAGMENT_ANSWER_COLOUR_R_W = 9;
  localparam int FRAGMENT_ANSWER_COLOUR_G_LSB = 18; localparam int FRAGMENT_ANSWER_COLOUR_G_W = 9;
  localparam int FRAGMENT_ANSWER_COLOUR_B_LSB = 9; localparam int FRAGMENT_ANSWER_COLOUR_B_W = 9;
  localparam int FRAGMENT_ANSWER_OPACITY_LSB = 0; localparam int FRAGMENT_ANSWER_OPACITY_W = 9;

  // fragment.start
  localparam int FRAGMENT_START_W = 143;
  localparam int FRAGMENT_START_X_LSB = 129; localparam int FRAGMENT_START_X_W = 14;
  localparam int FRAGMENT_START_Y_LSB = 115; localparam int FRAGMENT_START_Y_W = 14;
  localparam int FRAGMENT_START_SLOT_LSB = 111; localparam int FRAGMENT_START_SLOT_W = 4;
  localparam int FRAGMENT_START_SHADED_LSB = 110; localparam int FRAGMENT_START_SHADED_W = 1;
  localparam int FRAGMENT_START_DEPTH_LSB = 99; localparam int FRAGMENT_START_DEPTH_W = 11;
  localparam int FRAGMENT_START_MATERIAL_LSB = 91; localparam int FRAGMENT_START_MATERIAL_W = 8;
  localparam int FRAGMENT_START_WEIGHT_LSB = 80; localparam int FRAGMENT_START_WEIGHT_W = 11;
  localparam int FRAGMENT_START_COLOUR_R_LSB = 69; localparam int FRAGMENT_START_COLOUR_R_W = 11;
  localparam int FRAGMENT_START_COLOUR_G_LSB = 58; localparam int FRAGMENT_START_COLOUR_G_W = 11;
  localparam int FRAGMENT_START_COLOUR_B_LSB = 47; localparam int FRAGMENT_START_COLOUR_B_W = 11;
  localparam int FRAGMENT_START_OPACITY_LSB = 36; localparam int FRAGMENT_START_OPACITY_W = 11;
  localparam int FRAGMENT_START_NORMAL_X_LSB = 24; localparam int FRAGMENT_START_NORMAL_X_W = 12;
  localparam int FRAGMENT_START_NORMAL_Y_LSB = 12; localparam int FRAGMENT_START_NORMAL_Y_W = 12;
  localparam int FRAGMENT_START_NORMAL_Z_LSB = 0; localparam int FRAGMENT_START_NORMAL_Z_W = 12;

  // fragment.held
  localparam int FRAGMENT_HELD_W = 179;
  localparam int FRAGMENT_HELD_X_LSB = 165; localparam int FRAGMENT_HELD_X_W = 14;
  localparam int FRAGMENT_HELD_Y_LSB = 151; localparam int FRAGMENT_HELD_Y_W = 14;
  localparam int FRAGMENT_HELD_SLOT_LSB = 147; localparam int FRAGMENT_HELD_SLOT_W = 4;
  localparam int FRAGMENT_HELD_SHADED_LSB = 146; localparam int FRAGMENT_HELD_SHADED_W = 1;
  localparam int FRAGMENT_HELD_DEPTH_LSB = 135; localparam int FRAGMENT_HELD_DEPTH_W = 11;
  localparam int FRAGMENT_HELD_MATERIAL_LSB = 127; localparam int FRAGMENT_HELD_MATERIAL_W = 8;
  localparam int FRAGMENT_HELD_WEIGHT_LSB = 116; localparam int FRAGMENT_HELD_WEIGHT_W = 11;
  localparam int FRAGMENT_HELD_COLOUR_R_LSB = 105; localparam int FRAGMENT_HELD_COLOUR_R_W = 11;
  localparam int FRAGMENT_HELD_COLOUR_G_LSB = 94; localparam int FRAGMENT_HELD_COLOUR_G_W = 11;
  localparam int FRAGMENT_HELD_COLOUR_B_LSB = 83; localparam int FRAGMENT_HELD_COLOUR_B_W = 11;
  localparam int FRAGMENT_HELD_OPACITY_LSB = 72; localparam int FRAGMENT_HELD_OPACITY_W = 11;
  localparam int FRAGMENT_HELD_NORMAL_X_LSB = 60; localparam int FRAGMENT_HELD_NORMAL_X_W = 12;
  localparam int FRAGMENT_HELD_NORMAL_Y_LSB = 48; localparam int FRAGMENT_HELD_NORMAL_Y_W = 12;
  localparam int FRAGMENT_HELD_NORMAL_Z_LSB = 36; localparam int FRAGMENT_HELD_NORMAL_Z_W = 12;
  localparam int FRAGMENT_HELD_LIT_R_LSB = 27; localparam int FRAGMENT_HELD_LIT_R_W = 9;
  localparam int FRAGMENT_HELD_LIT_G_LSB = 18; localparam int FRAGMENT_HELD_LIT_G_W = 9;
  localparam int FRAGMENT_HELD_LIT_B_LSB = 9; localparam int FRAGMENT_HELD_LIT_B_W = 9;
  localparam int FRAGMENT_HELD_LIT_OPACITY_LSB = 0; localparam int FRAGMENT_HELD_LIT_OPACITY_W = 9;

  // shade.in
  localparam int SHADE_IN_W = 99;
  localparam int SHADE_IN_WEIGHT_LSB = 88; localparam int SHADE_IN_WEIGHT_W = 11;
  localparam int SHADE_IN_COLOUR_R_LSB = 77; localparam int SHADE_IN_COLOUR_R_W = 11;
  localparam int SHADE_IN_COLOUR_G_LSB = 66; localparam int SHADE_IN_COLOUR_G_W = 11;
  localparam int SHADE_IN_COLOUR_B_LSB = 55; localparam int SHADE_IN_COLOUR_B_W = 11;
  localparam int SHADE_IN_OPACITY_LSB = 44; localparam int SHADE_IN_OPACITY_W = 11;
  localparam int SHADE_IN_NORMAL_X_LSB = 32; localparam int SHADE_IN_NORMAL_X_W = 12;
  localparam int SHADE_IN_NORMAL_Y_LSB = 20; localparam int SHADE_IN_NORMAL_Y_W = 12;
  localparam int SHADE_IN_NORMAL_Z_LSB = 8; localparam int SHADE_IN_NORMAL_Z_W = 12;
  localparam int SHADE_IN_MATERIAL_LSB = 0; localparam int SHADE_IN_MATERIAL_W = 8;

  // shade.out
  localparam int SHADE_OUT_W = 36;
  localparam int SHADE_OUT_COLOUR_R_LSB = 27; localparam int SHADE_OUT_COLOUR_R_W = 9;
  localparam int SHADE_OUT_COLOUR_G_LSB = 18; localparam int SHADE_OUT_COLOUR_G_W = 9;
  localparam int SHADE_OUT_COLOUR_B_LSB = 9; localparam int SHADE_OUT_COLOUR_B_W = 9;
  localparam int SHADE_OUT_OPACITY_LSB = 0; localparam int SHADE_OUT_OPACITY_W = 9;

  // resolve.in
  localparam int RESOLVE_IN_W = 66;
  localparam int RESOLVE_IN_X_LSB = 52; localparam int RESOLVE_IN_X_W = 14;
  localparam int RESOLVE_IN_Y_LSB = 38; localparam int RESOLVE_IN_Y_W = 14;
  localparam int RESOLVE_IN_LAST_LSB = 37; localparam int RESOLVE_IN_LAST_W = 1;
  localparam int RESOLVE_IN_EMPTY_LSB = 36; localparam int RESOLVE_IN_EMPTY_W = 1;
  localparam int RESOLVE_IN_COLOUR_R_LSB = 27; localparam int RESOLVE_IN_COLOUR_R_W = 9;
  localparam int RESOLVE_IN_COLOUR_G_LSB = 18; localparam int RESOLVE_IN_COLOUR_G_W = 9;
  localparam int RESOLVE_IN_COLOUR_B_LSB = 9; localparam int RESOLVE_IN_COLOUR_B_W = 9;
  localparam int RESOLVE_IN_OPACITY_LSB = 0; localparam int RESOLVE_IN_OPACITY_W = 9;

  // resolve.out
  localparam int RESOLVE_OUT_W = 64;
  localparam int RESOLVE_OUT_X_LSB = 50; localparam int RESOLVE_OUT_X_W = 14;
  localparam int RESOLVE_OUT_Y_LSB = 36; localparam int RESOLVE_OUT_Y_W = 14;
  localparam int RESOLVE_OUT_RED_LSB = 27; localparam int RESOLVE_OUT_RED_W = 9;
  localparam int RESOLVE_OUT_GREEN_LSB = 18; localparam int RESOLVE_OUT_GREEN_W = 9;
  localparam int RESOLVE_OUT_BLUE_LSB = 9; localparam int RESOLVE_OUT_BLUE_W = 9;
  localparam int RESOLVE_OUT_ALPHA_LSB = 0; localparam int RESOLVE_OUT_ALPHA_W = 9;

  // pipeline.out
  localparam int PIPELINE_OUT_W = 64;
  localparam int PIPELINE_OUT_X_LSB = 50; localparam int PIPELINE_OUT_X_W = 14;
  localparam int PIPELINE_OUT_Y_LSB = 36; localparam int PIPELINE_OUT_Y_W = 14;
  localparam int PIPELINE_OUT_RED_LSB = 27; localparam int PIPELINE_OUT_RED_W = 9;
  localparam int PIPELINE_OUT_GREEN_LSB = 18; localparam int PIPELINE_OUT_GREEN_W = 9;
  localparam int PIPELINE_OUT_BLUE_LSB = 9; localparam int PIPELINE_OUT_BLUE_W = 9;
  localparam int PIPELINE_OUT_ALPHA_LSB = 0; localparam int PIPELINE_OUT_ALPHA_W = 9;

  // All lights, all materials, and the reflection of each light by each material: concatenated, the first in the low bits.
  localparam int LIGHTS_PORT_W = 61;
  localparam int MATERIALS_PORT_W = 10;
  localparam int REFLECTIONS_PORT_W = 54;
endpackage
/* verilator lint_on UNUSEDPARAM */
`default_nettype wire
