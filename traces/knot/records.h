/* Records of a trace: bit places, structs and tables of fields. value = word * 2^-fraction_bits */
#ifndef SPLATSIM_RECORDS_H
#define SPLATSIM_RECORDS_H
#include <stdint.h>

typedef struct {
  const char *name;
  int lsb, width, is_signed, fraction_bits;
} splatsim_field;

#define FRAME_WIDTH 332
#define FRAME_FIELDS 32
typedef struct {
  int64_t width; /* U15F0 */
  int64_t height; /* U15F0 */
  int64_t rotation_00; /* I2F8, project.rotation */
  int64_t rotation_01; /* I2F8, project.rotation */
  int64_t rotation_02; /* I2F8, project.rotation */
  int64_t rotation_10; /* I2F8, project.rotation */
  int64_t rotation_11; /* I2F8, project.rotation */
  int64_t rotation_12; /* I2F8, project.rotation */
  int64_t rotation_20; /* I2F8, project.rotation */
  int64_t rotation_21; /* I2F8, project.rotation */
  int64_t rotation_22; /* I2F8, project.rotation */
  int64_t eye_x; /* I3F11, project.eye */
  int64_t eye_y; /* I3F11, project.eye */
  int64_t eye_z; /* I3F11, project.eye */
  int64_t near; /* U1F12, project.depth */
  int64_t guard_x; /* I2F9, project.slope */
  int64_t guard_y; /* I2F9, project.slope */
  int64_t focal; /* U11F2, project.focal */
  int64_t inverse_focal; /* U1F8, ellipse.inverse_focal */
  int64_t inverse_focal_places; /* I8F0 */
  int64_t low_pass; /* U3F8, ellipse.low_pass */
  int64_t cutoff; /* U5F4, raster.cutoff */
  int64_t root_cutoff; /* U3F6, ellipse.root_cutoff */
  int64_t cull_backfaces; /* U1F0 */
  int64_t z_threshold; /* U1F10, fragment.depth */
  int64_t coverage_threshold; /* U3F8, fragment.weight_sum */
  int64_t inverse_threshold; /* U1F8, shade.inverse_threshold */
  int64_t inverse_threshold_places; /* I8F0 */
  int64_t background_r; /* U1F8, resolve.frame */
  int64_t background_g; /* U1F8, resolve.frame */
  int64_t background_b; /* U1F8, resolve.frame */
  int64_t background_a; /* U1F8, resolve.frame */
} frame_record;
static const splatsim_field frame_fields[FRAME_FIELDS] = {
  {"width", 317, 15, 0, 0},
  {"height", 302, 15, 0, 0},
  {"rotation_00", 292, 10, 1, 8},
  {"rotation_01", 282, 10, 1, 8},
  {"rotation_02", 272, 10, 1, 8},
  {"rotation_10", 262, 10, 1, 8},
  {"rotation_11", 252, 10, 1, 8},
  {"rotation_12", 242, 10, 1, 8},
  {"rotation_20", 232, 10, 1, 8},
  {"rotation_21", 222, 10, 1, 8},
  {"rotation_22", 212, 10, 1, 8},
  {"eye_x", 198, 14, 1, 11},
  {"eye_y", 184, 14, 1, 11},
  {"eye_z", 170, 14, 1, 11},
  {"near", 157, 13, 0, 12},
  {"guard_x", 146, 11, 1, 9},
  {"guard_y", 135, 11, 1, 9},
  {"focal", 122, 13, 0, 2},
  {"inverse_focal", 113, 9, 0, 8},
  {"inverse_focal_places", 105, 8, 1, 0},
  {"low_pass", 94, 11, 0, 8},
  {"cutoff", 85, 9, 0, 4},
  {"root_cutoff", 76, 9, 0, 6},
  {"cull_backfaces", 75, 1, 0, 0},
  {"z_threshold", 64, 11, 0, 10},
  {"coverage_threshold", 53, 11, 0, 8},
  {"inverse_threshold", 44, 9, 0, 8},
  {"inverse_threshold_places", 36, 8, 1, 0},
  {"background_r", 27, 9, 0, 8},
  {"background_g", 18, 9, 0, 8},
  {"background_b", 9, 9, 0, 8},
  {"background_a", 0, 9, 0, 8},
};

#define LIGHT_WIDTH 61
#define LIGHT_FIELDS 7
typedef struct {
  int64_t direction_x; /* I2F8, shade.light */
  int64_t direction_y; /* I2F8, shade.light */
  int64_t direction_z; /* I2F8, shade.light */
  int64_t has_half_way; /* U1F0 */
  int64_t half_way_x; /* I2F8, shade.light */
  int64_t half_way_y; /* I2F8, shade.light */
  int64_t half_way_z; /* I2F8, shade.light */
} light_record;
static const splatsim_field light_fields[LIGHT_FIELDS] = {
  {"direction_x", 51, 10, 1, 8},
  {"direction_y", 41, 10, 1, 8},
  {"direction_z", 31, 10, 1, 8},
  {"has_half_way", 30, 1, 0, 0},
  {"half_way_x", 20, 10, 1, 8},
  {"half_way_y", 10, 10, 1, 8},
  {"half_way_z", 0, 10, 1, 8},
};

#define MATERIAL_WIDTH 10
#define MATERIAL_FIELDS 2
typedef struct {
  int64_t unlit; /* U1F0 */
  int64_t ambient; /* U3F6, shade.reflectance */
} material_record;
static const splatsim_field material_fields[MATERIAL_FIELDS] = {
  {"unlit", 9, 1, 0, 0},
  {"ambient", 0, 9, 0, 6},
};

#define REFLECTION_WIDTH 54
#define REFLECTION_FIELDS 6
typedef struct {
  int64_t diffuse_r; /* U3F6, shade.reflectance */
  int64_t diffuse_g; /* U3F6, shade.reflectance */
  int64_t diffuse_b; /* U3F6, shade.reflectance */
  int64_t specular_r; /* U3F6, shade.reflectance */
  int64_t specular_g; /* U3F6, shade.reflectance */
  int64_t specular_b; /* U3F6, shade.reflectance */
} reflection_record;
static const splatsim_field reflection_fields[REFLECTION_FIELDS] = {
  {"diffuse_r", 45, 9, 0, 6},
  {"diffuse_g", 36, 9, 0, 6},
  {"diffuse_b", 27, 9, 0, 6},
  {"specular_r", 18, 9, 0, 6},
  {"specular_g", 9, 9, 0, 6},
  {"specular_b", 0, 9, 0, 6},
};

#define PIPELINE_IN_WIDTH 111
#define PIPELINE_IN_FIELDS 12
typedef struct {
  int64_t position_x; /* I1F11, splat.position */
  int64_t position_y; /* I1F11, splat.position */
  int64_t position_z; /* I1F11, splat.position */
  int64_t normal_x; /* I2F6, splat.normal */
  int64_t normal_y; /* I2F6, splat.normal */
  int64_t normal_z; /* I2F6, splat.normal */
  int64_t radius; /* U-3F14, splat.radius */
  int64_t red; /* U1F7, splat.rgb */
  int64_t green; /* U1F7, splat.rgb */
  int64_t blue; /* U1F7, splat.rgb */
  int64_t opacity; /* U1F7, splat.opacity */
  int64_t material; /* U8F0 */
} pipeline_in_record;
static const splatsim_field pipeline_in_fields[PIPELINE_IN_FIELDS] = {
  {"position_x", 99, 12, 1, 11},
  {"position_y", 87, 12, 1, 11},
  {"position_z", 75, 12, 1, 11},
  {"normal_x", 67, 8, 1, 6},
  {"normal_y", 59, 8, 1, 6},
  {"normal_z", 51, 8, 1, 6},
  {"radius", 40, 11, 0, 14},
  {"red", 32, 8, 0, 7},
  {"green", 24, 8, 0, 7},
  {"blue", 16, 8, 0, 7},
  {"opacity", 8, 8, 0, 7},
  {"material", 0, 8, 0, 0},
};

#define PROJECT_IN_WIDTH 36
#define PROJECT_IN_FIELDS 3
typedef struct {
  int64_t position_x; /* I1F11, splat.position */
  int64_t position_y; /* I1F11, splat.position */
  int64_t position_z; /* I1F11, splat.position */
} project_in_record;
static const splatsim_field project_in_fields[PROJECT_IN_FIELDS] = {
  {"position_x", 24, 12, 1, 11},
  {"position_y", 12, 12, 1, 11},
  {"position_z", 0, 12, 1, 11},
};

#define PROJECT_OUT_WIDTH 104
#define PROJECT_OUT_FIELDS 11
typedef struct {
  int64_t near; /* U1F0 */
  int64_t outside; /* U1F0 */
  int64_t forward; /* I2F9, project.camera */
  int64_t exponent; /* I8F0 */
  int64_t depth; /* U1F12, project.depth */
  int64_t inverse_depth; /* U1F9, project.reciprocal.result */
  int64_t inverse_depth_exponent; /* I8F0 */
  int64_t slope_x; /* I2F9, project.slope */
  int64_t slope_y; /* I2F9, project.slope */
  int64_t pixel_x; /* I12F3, project.pixel */
  int64_t pixel_y; /* I12F3, project.pixel */
} project_out_record;
static const splatsim_field project_out_fields[PROJECT_OUT_FIELDS] = {
  {"near", 103, 1, 0, 0},
  {"outside", 102, 1, 0, 0},
  {"forward", 91, 11, 1, 9},
  {"exponent", 83, 8, 1, 0},
  {"depth", 70, 13, 0, 12},
  {"inverse_depth", 60, 10, 0, 9},
  {"inverse_depth_exponent", 52, 8, 1, 0},
  {"slope_x", 41, 11, 1, 9},
  {"slope_y", 30, 11, 1, 9},
  {"pixel_x", 15, 15, 1, 3},
  {"pixel_y", 0, 15, 1, 3},
};

#define ELLIPSE_IN_WIDTH 124
#define ELLIPSE_IN_FIELDS 12
typedef struct {
  int64_t normal_x; /* I2F6, splat.normal */
  int64_t normal_y; /* I2F6, splat.normal */
  int64_t normal_z; /* I2F6, splat.normal */
  int64_t radius; /* U-3F14, splat.radius */
  int64_t forward; /* I2F9, project.camera */
  int64_t exponent; /* I8F0 */
  int64_t inverse_depth; /* U1F9, project.reciprocal.result */
  int64_t inverse_depth_exponent; /* I8F0 */
  int64_t slope_x; /* I2F9, project.slope */
  int64_t slope_y; /* I2F9, project.slope */
  int64_t pixel_x; /* I12F3, project.pixel */
  int64_t pixel_y; /* I12F3, project.pixel */
} ellipse_in_record;
static const splatsim_field ellipse_in_fields[ELLIPSE_IN_FIELDS] = {
  {"normal_x", 116, 8, 1, 6},
  {"normal_y", 108, 8, 1, 6},
  {"normal_z", 100, 8, 1, 6},
  {"radius", 89, 11, 0, 14},
  {"forward", 78, 11, 1, 9},
  {"exponent", 70, 8, 1, 0},
  {"inverse_depth", 60, 10, 0, 9},
  {"inverse_depth_exponent", 52, 8, 1, 0},
  {"slope_x", 41, 11, 1, 9},
  {"slope_y", 30, 11, 1, 9},
  {"pixel_x", 15, 15, 1, 3},
  {"pixel_y", 0, 15, 1, 3},
};

#define ELLIPSE_OUT_WIDTH 151
#define ELLIPSE_OUT_FIELDS 17
typedef struct {
  int64_t backface; /* U1F0 */
  int64_t faint; /* U1F0 */
  int64_t outside; /* U1F0 */
  int64_t normal_x; /* I2F6, fragment.normal */
  int64_t normal_y; /* I2F6, fragment.normal */
  int64_t normal_z; /* I2F6, fragment.normal */
  int64_t conic_xx; /* U2F8, ellipse.conic */
  int64_t conic_xy; /* I2F8, ellipse.conic_cross */
  int64_t conic_yy; /* U2F8, ellipse.conic */
  int64_t amplitude; /* U-2F10, ellipse.amplitude */
  int64_t first_column; /* U14F0 */
  int64_t last_column; /* U14F0 */
  int64_t first_row; /* U14F0 */
  int64_t last_row; /* U14F0 */
  int64_t depth_slope_x; /* I1F10, ellipse.depth_slope */
  int64_t depth_slope_y; /* I1F10, ellipse.depth_slope */
  int64_t depth_range; /* U-3F11, ellipse.depth_range */
} ellipse_out_record;
static const splatsim_field ellipse_out_fields[ELLIPSE_OUT_FIELDS] = {
  {"backface", 150, 1, 0, 0},
  {"faint", 149, 1, 0, 0},
  {"outside", 148, 1, 0, 0},
  {"normal_x", 140, 8, 1, 6},
  {"normal_y", 132, 8, 1, 6},
  {"normal_z", 124, 8, 1, 6},
  {"conic_xx", 114, 10, 0, 8},
  {"conic_xy", 104, 10, 1, 8},
  {"conic_yy", 94, 10, 0, 8},
  {"amplitude", 86, 8, 0, 10},
  {"first_column", 72, 14, 0, 0},
  {"last_column", 58, 14, 0, 0},
  {"first_row", 44, 14, 0, 0},
  {"last_row", 30, 14, 0, 0},
  {"depth_slope_x", 19, 11, 1, 10},
  {"depth_slope_y", 8, 11, 1, 10},
  {"depth_range", 0, 8, 0, 11},
};

#define RASTER_IN_WIDTH 191
#define RASTER_IN_FIELDS 14
typedef struct {
  int64_t tag; /* U32F0 */
  int64_t pixel_x; /* I12F3, project.pixel */
  int64_t pixel_y; /* I12F3, project.pixel */
  int64_t conic_xx; /* U2F8, ellipse.conic */
  int64_t conic_xy; /* I2F8, ellipse.conic_cross */
  int64_t conic_yy; /* U2F8, ellipse.conic */
  int64_t depth; /* U1F12, project.depth */
  int64_t depth_slope_x; /* I1F10, ellipse.depth_slope */
  int64_t depth_slope_y; /* I1F10, ellipse.depth_slope */
  int64_t depth_range; /* U-3F11, ellipse.depth_range */
  int64_t first_column; /* U14F0 */
  int64_t last_column; /* U14F0 */
  int64_t first_row; /* U14F0 */
  int64_t last_row; /* U14F0 */
} raster_in_record;
static const splatsim_field raster_in_fields[RASTER_IN_FIELDS] = {
  {"tag", 159, 32, 0, 0},
  {"pixel_x", 144, 15, 1, 3},
  {"pixel_y", 129, 15, 1, 3},
  {"conic_xx", 119, 10, 0, 8},
  {"conic_xy", 109, 10, 1, 8},
  {"conic_yy", 99, 10, 0, 8},
  {"depth", 86, 13, 0, 12},
  {"depth_slope_x", 75, 11, 1, 10},
  {"depth_slope_y", 64, 11, 1, 10},
  {"depth_range", 56, 8, 0, 11},
  {"first_column", 42, 14, 0, 0},
  {"last_column", 28, 14, 0, 0},
  {"first_row", 14, 14, 0, 0},
  {"last_row", 0, 14, 0, 0},
};

#define RASTER_OUT_WIDTH 94
#define RASTER_OUT_FIELDS 5
typedef struct {
  int64_t tag; /* U32F0 */
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t radial; /* I9F8, raster.radial */
  int64_t depth; /* I5F12 */
} raster_out_record;
static const splatsim_field raster_out_fields[RASTER_OUT_FIELDS] = {
  {"tag", 62, 32, 0, 0},
  {"x", 48, 14, 0, 0},
  {"y", 34, 14, 0, 0},
  {"radial", 17, 17, 1, 8},
  {"depth", 0, 17, 1, 12},
};

#define GAUSS_IN_WIDTH 25
#define GAUSS_IN_FIELDS 2
typedef struct {
  int64_t radial; /* I9F8, raster.radial */
  int64_t amplitude; /* U-2F10, ellipse.amplitude */
} gauss_in_record;
static const splatsim_field gauss_in_fields[GAUSS_IN_FIELDS] = {
  {"radial", 8, 17, 1, 8},
  {"amplitude", 0, 8, 0, 10},
};

#define GAUSS_OUT_WIDTH 8
#define GAUSS_OUT_FIELDS 1
typedef struct {
  int64_t weight; /* U-2F10, gauss.weight */
} gauss_out_record;
static const splatsim_field gauss_out_fields[GAUSS_OUT_FIELDS] = {
  {"weight", 0, 8, 0, 10},
};

#define FRAGMENT_IN_WIDTH 117
#define FRAGMENT_IN_FIELDS 12
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t weight; /* U-2F10, gauss.weight */
  int64_t depth; /* I5F12 */
  int64_t red; /* U1F7, splat.rgb */
  int64_t green; /* U1F7, splat.rgb */
  int64_t blue; /* U1F7, splat.rgb */
  int64_t opacity; /* U1F7, splat.opacity */
  int64_t normal_x; /* I2F6, fragment.normal */
  int64_t normal_y; /* I2F6, fragment.normal */
  int64_t normal_z; /* I2F6, fragment.normal */
  int64_t material; /* U8F0 */
} fragment_in_record;
static const splatsim_field fragment_in_fields[FRAGMENT_IN_FIELDS] = {
  {"x", 103, 14, 0, 0},
  {"y", 89, 14, 0, 0},
  {"weight", 81, 8, 0, 10},
  {"depth", 64, 17, 1, 12},
  {"red", 56, 8, 0, 7},
  {"green", 48, 8, 0, 7},
  {"blue", 40, 8, 0, 7},
  {"opacity", 32, 8, 0, 7},
  {"normal_x", 24, 8, 1, 6},
  {"normal_y", 16, 8, 1, 6},
  {"normal_z", 8, 8, 1, 6},
  {"material", 0, 8, 0, 0},
};

#define FRAGMENT_OUT_WIDTH 35
#define FRAGMENT_OUT_FIELDS 4
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t outcome; /* U3F0 */
  int64_t slot; /* U4F0 */
} fragment_out_record;
static const splatsim_field fragment_out_fields[FRAGMENT_OUT_FIELDS] = {
  {"x", 21, 14, 0, 0},
  {"y", 7, 14, 0, 0},
  {"outcome", 4, 3, 0, 0},
  {"slot", 0, 4, 0, 0},
};

#define FRAGMENT_REQUEST_WIDTH 99
#define FRAGMENT_REQUEST_FIELDS 9
typedef struct {
  int64_t weight; /* U3F8, fragment.weight_sum */
  int64_t colour_r; /* U3F8, fragment.colour_sum */
  int64_t colour_g; /* U3F8, fragment.colour_sum */
  int64_t colour_b; /* U3F8, fragment.colour_sum */
  int64_t opacity; /* U3F8, fragment.opacity_sum */
  int64_t normal_x; /* I4F8, fragment.normal_sum */
  int64_t normal_y; /* I4F8, fragment.normal_sum */
  int64_t normal_z; /* I4F8, fragment.normal_sum */
  int64_t material; /* U8F0 */
} fragment_request_record;
static const splatsim_field fragment_request_fields[FRAGMENT_REQUEST_FIELDS] = {
  {"weight", 88, 11, 0, 8},
  {"colour_r", 77, 11, 0, 8},
  {"colour_g", 66, 11, 0, 8},
  {"colour_b", 55, 11, 0, 8},
  {"opacity", 44, 11, 0, 8},
  {"normal_x", 32, 12, 1, 8},
  {"normal_y", 20, 12, 1, 8},
  {"normal_z", 8, 12, 1, 8},
  {"material", 0, 8, 0, 0},
};

#define FRAGMENT_ANSWER_WIDTH 36
#define FRAGMENT_ANSWER_FIELDS 4
typedef struct {
  int64_t colour_r; /* U1F8, shade.premultiplied */
  int64_t colour_g; /* U1F8, shade.premultiplied */
  int64_t colour_b; /* U1F8, shade.premultiplied */
  int64_t opacity; /* U1F8, shade.premultiplied */
} fragment_answer_record;
static const splatsim_field fragment_answer_fields[FRAGMENT_ANSWER_FIELDS] = {
  {"colour_r", 27, 9, 0, 8},
  {"colour_g", 18, 9, 0, 8},
  {"colour_b", 9, 9, 0, 8},
  {"opacity", 0, 9, 0, 8},
};

#define FRAGMENT_START_WIDTH 143
#define FRAGMENT_START_FIELDS 14
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t slot; /* U4F0 */
  int64_t shaded; /* U1F0 */
  int64_t depth; /* U1F10, fragment.depth */
  int64_t material; /* U8F0 */
  int64_t weight; /* U3F8, fragment.weight_sum */
  int64_t colour_r; /* U3F8, fragment.colour_sum */
  int64_t colour_g; /* U3F8, fragment.colour_sum */
  int64_t colour_b; /* U3F8, fragment.colour_sum */
  int64_t opacity; /* U3F8, fragment.opacity_sum */
  int64_t normal_x; /* I4F8, fragment.normal_sum */
  int64_t normal_y; /* I4F8, fragment.normal_sum */
  int64_t normal_z; /* I4F8, fragment.normal_sum */
} fragment_start_record;
static const splatsim_field fragment_start_fields[FRAGMENT_START_FIELDS] = {
  {"x", 129, 14, 0, 0},
  {"y", 115, 14, 0, 0},
  {"slot", 111, 4, 0, 0},
  {"shaded", 110, 1, 0, 0},
  {"depth", 99, 11, 0, 10},
  {"material", 91, 8, 0, 0},
  {"weight", 80, 11, 0, 8},
  {"colour_r", 69, 11, 0, 8},
  {"colour_g", 58, 11, 0, 8},
  {"colour_b", 47, 11, 0, 8},
  {"opacity", 36, 11, 0, 8},
  {"normal_x", 24, 12, 1, 8},
  {"normal_y", 12, 12, 1, 8},
  {"normal_z", 0, 12, 1, 8},
};

#define FRAGMENT_HELD_WIDTH 179
#define FRAGMENT_HELD_FIELDS 18
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t slot; /* U4F0 */
  int64_t shaded; /* U1F0 */
  int64_t depth; /* U1F10, fragment.depth */
  int64_t material; /* U8F0 */
  int64_t weight; /* U3F8, fragment.weight_sum */
  int64_t colour_r; /* U3F8, fragment.colour_sum */
  int64_t colour_g; /* U3F8, fragment.colour_sum */
  int64_t colour_b; /* U3F8, fragment.colour_sum */
  int64_t opacity; /* U3F8, fragment.opacity_sum */
  int64_t normal_x; /* I4F8, fragment.normal_sum */
  int64_t normal_y; /* I4F8, fragment.normal_sum */
  int64_t normal_z; /* I4F8, fragment.normal_sum */
  int64_t lit_r; /* U1F8, shade.premultiplied */
  int64_t lit_g; /* U1F8, shade.premultiplied */
  int64_t lit_b; /* U1F8, shade.premultiplied */
  int64_t lit_opacity; /* U1F8, shade.premultiplied */
} fragment_held_record;
static const splatsim_field fragment_held_fields[FRAGMENT_HELD_FIELDS] = {
  {"x", 165, 14, 0, 0},
  {"y", 151, 14, 0, 0},
  {"slot", 147, 4, 0, 0},
  {"shaded", 146, 1, 0, 0},
  {"depth", 135, 11, 0, 10},
  {"material", 127, 8, 0, 0},
  {"weight", 116, 11, 0, 8},
  {"colour_r", 105, 11, 0, 8},
  {"colour_g", 94, 11, 0, 8},
  {"colour_b", 83, 11, 0, 8},
  {"opacity", 72, 11, 0, 8},
  {"normal_x", 60, 12, 1, 8},
  {"normal_y", 48, 12, 1, 8},
  {"normal_z", 36, 12, 1, 8},
  {"lit_r", 27, 9, 0, 8},
  {"lit_g", 18, 9, 0, 8},
  {"lit_b", 9, 9, 0, 8},
  {"lit_opacity", 0, 9, 0, 8},
};

#define SHADE_IN_WIDTH 99
#define SHADE_IN_FIELDS 9
typedef struct {
  int64_t weight; /* U3F8, fragment.weight_sum */
  int64_t colour_r; /* U3F8, fragment.colour_sum */
  int64_t colour_g; /* U3F8, fragment.colour_sum */
  int64_t colour_b; /* U3F8, fragment.colour_sum */
  int64_t opacity; /* U3F8, fragment.opacity_sum */
  int64_t normal_x; /* I4F8, fragment.normal_sum */
  int64_t normal_y; /* I4F8, fragment.normal_sum */
  int64_t normal_z; /* I4F8, fragment.normal_sum */
  int64_t material; /* U8F0 */
} shade_in_record;
static const splatsim_field shade_in_fields[SHADE_IN_FIELDS] = {
  {"weight", 88, 11, 0, 8},
  {"colour_r", 77, 11, 0, 8},
  {"colour_g", 66, 11, 0, 8},
  {"colour_b", 55, 11, 0, 8},
  {"opacity", 44, 11, 0, 8},
  {"normal_x", 32, 12, 1, 8},
  {"normal_y", 20, 12, 1, 8},
  {"normal_z", 8, 12, 1, 8},
  {"material", 0, 8, 0, 0},
};

#define SHADE_OUT_WIDTH 36
#define SHADE_OUT_FIELDS 4
typedef struct {
  int64_t colour_r; /* U1F8, shade.premultiplied */
  int64_t colour_g; /* U1F8, shade.premultiplied */
  int64_t colour_b; /* U1F8, shade.premultiplied */
  int64_t opacity; /* U1F8, shade.premultiplied */
} shade_out_record;
static const splatsim_field shade_out_fields[SHADE_OUT_FIELDS] = {
  {"colour_r", 27, 9, 0, 8},
  {"colour_g", 18, 9, 0, 8},
  {"colour_b", 9, 9, 0, 8},
  {"opacity", 0, 9, 0, 8},
};

#define RESOLVE_IN_WIDTH 66
#define RESOLVE_IN_FIELDS 8
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t last; /* U1F0 */
  int64_t empty; /* U1F0 */
  int64_t colour_r; /* U1F8, shade.premultiplied */
  int64_t colour_g; /* U1F8, shade.premultiplied */
  int64_t colour_b; /* U1F8, shade.premultiplied */
  int64_t opacity; /* U1F8, shade.premultiplied */
} resolve_in_record;
static const splatsim_field resolve_in_fields[RESOLVE_IN_FIELDS] = {
  {"x", 52, 14, 0, 0},
  {"y", 38, 14, 0, 0},
  {"last", 37, 1, 0, 0},
  {"empty", 36, 1, 0, 0},
  {"colour_r", 27, 9, 0, 8},
  {"colour_g", 18, 9, 0, 8},
  {"colour_b", 9, 9, 0, 8},
  {"opacity", 0, 9, 0, 8},
};

#define RESOLVE_OUT_WIDTH 64
#define RESOLVE_OUT_FIELDS 6
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t red; /* U1F8, resolve.frame */
  int64_t green; /* U1F8, resolve.frame */
  int64_t blue; /* U1F8, resolve.frame */
  int64_t alpha; /* U1F8, resolve.frame */
} resolve_out_record;
static const splatsim_field resolve_out_fields[RESOLVE_OUT_FIELDS] = {
  {"x", 50, 14, 0, 0},
  {"y", 36, 14, 0, 0},
  {"red", 27, 9, 0, 8},
  {"green", 18, 9, 0, 8},
  {"blue", 9, 9, 0, 8},
  {"alpha", 0, 9, 0, 8},
};

#define PIPELINE_OUT_WIDTH 64
#define PIPELINE_OUT_FIELDS 6
typedef struct {
  int64_t x; /* U14F0 */
  int64_t y; /* U14F0 */
  int64_t red; /* U1F8, resolve.frame */
  int64_t green; /* U1F8, resolve.frame */
  int64_t blue; /* U1F8, resolve.frame */
  int64_t alpha; /* U1F8, resolve.frame */
} pipeline_out_record;
static const splatsim_field pipeline_out_fields[PIPELINE_OUT_FIELDS] = {
  {"x", 50, 14, 0, 0},
  {"y", 36, 14, 0, 0},
  {"red", 27, 9, 0, 8},
  {"green", 18, 9, 0, 8},
  {"blue", 9, 9, 0, 8},
  {"alpha", 0, 9, 0, 8},
};

#endif
