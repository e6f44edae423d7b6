/* Draws a scene, runs units of the machine on random records, and compares their output.
 *
 * units SCENE.json [UNIT...]: checks these units, or all; prints the results; returns 0 on success. */
#include "splatsim.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fail(const char *what) {
  fprintf(stderr, "%s: %s\n", what, splatsim_last_error());
  return 1;
}

/* Draws a picture and the report. */
static int draw(const splatsim_machine *machine, const splatsim_scene *scene) {
  splatsim_drawing *drawing = splatsim_draw(machine, scene);
  uint32_t width = 0, height = 0;
  double *rgba = NULL, *exact = NULL;
  char *report = NULL;
  ptrdiff_t length = 0;
  size_t count, i;
  double most = 0.0;
  int failed = 1;
  if (drawing == NULL || splatsim_drawing_size(drawing, &width, &height) != 0) {
    splatsim_drawing_free(drawing);
    return fail("draw");
  }
  count = (size_t)4 * width * height;
  rgba = malloc(count * sizeof *rgba);
  exact = malloc(count * sizeof *exact);
  length = splatsim_report_json(drawing, NULL, 0);
  report = length < 0 ? NULL : malloc((size_t)length + 1);
  if (rgba != NULL && exact != NULL && report != NULL && splatsim_picture(drawing, SPLATSIM_FIXED, rgba, count) == 0 &&
      splatsim_picture(drawing, SPLATSIM_IDEAL, exact, count) == 0 && splatsim_picture(drawing, SPLATSIM_FIXED, rgba, count - 1) == -1 &&
      splatsim_picture(drawing, 7, rgba, count) == -1 && splatsim_report_json(drawing, report, (size_t)length + 1) == length &&
      strlen(report) == (size_t)length && strstr(report, "\"accuracy\"") != NULL) {
    for (i = 0; i < count; i++) {
      double difference = rgba[i] > exact[i] ? rgba[i] - exact[i] : exact[i] - rgba[i];
      most = difference > most ? difference : most;
    }
    printf("%u x %u pixels, at most %.3f off, a report of %ld bytes\n", (unsigned)width, (unsigned)height, most, (long)length);
    failed = 0;
  } else {
    failed = fail("picture and report");
  }
  free(report);
  free(exact);
  free(rgba);
  splatsim_drawing_free(drawing);
  return failed;
}

/* Compares the output of two equal units as bits, and the numbers of queued records; then their output at the end of a frame. */
static int bits_and_ends(splatsim_unit *unit, splatsim_unit *other, const char *name) {
  /* In resolve a pixel may be incomplete: then the end is refused, and its layers are dropped. */
  const int may_refuse = strcmp(name, "resolve") == 0;
  const int ports[2] = {SPLATSIM_OUT, SPLATSIM_HELD};
  uint32_t bits[32];
  ptrdiff_t waiting, ended;
  int i, port;
  if (splatsim_unit_width(unit, SPLATSIM_OUT) < 1 || splatsim_unit_width(unit, SPLATSIM_OUT) > 32 * 32) return 1;
  for (i = 0; i < 50; i++) {
    if (splatsim_unit_random_bits(unit, bits, 32) != 0) return 1;
    waiting = splatsim_unit_step_bits(unit, bits, 32);
    if (waiting < 0 || waiting != splatsim_unit_waiting(unit, SPLATSIM_OUT) || splatsim_unit_step_bits(other, bits, 32) != waiting) return 1;
    for (; splatsim_unit_next_bits(unit, SPLATSIM_OUT, bits, 32) == 1; waiting--)
      if (splatsim_unit_compare_bits(other, SPLATSIM_OUT, bits, 32) != 0) return 1;
    if (waiting != 0 || splatsim_unit_waiting(other, SPLATSIM_OUT) != 0) return 1;
  }
  ended = splatsim_unit_end(unit);
  if (splatsim_unit_end(other) != ended || (ended < 0 && !may_refuse)) return 1;
  waiting = ended < 0 ? 0 : ended;
  for (port = 0; port < 2; port++) {
    if (splatsim_unit_fields(unit, ports[port]) < 0) continue;
    for (; splatsim_unit_next_bits(unit, ports[port], bits, 32) == 1; waiting--)
      if (splatsim_unit_compare_bits(other, ports[port], bits, 32) != 0) return 1;
  }
  return waiting != 0;
}

/* Compares the output of two equal units on random records, as words and as bits; then a wrong record. */
static int compare(const splatsim_machine *machine, const splatsim_scene *scene, const char *name) {
  splatsim_unit *unit = splatsim_unit_new(machine, scene, name, 1), *other = splatsim_unit_new(machine, scene, name, 1);
  int64_t in[32], out[32];
  uint32_t bits[32];
  ptrdiff_t fields_in, fields_out;
  long compared = 0;
  int failed = 1, differs = 0, i;
  if (unit == NULL || other == NULL) {
    splatsim_unit_free(unit);
    splatsim_unit_free(other);
    return fail(name);
  }
  fields_in = splatsim_unit_fields(unit, SPLATSIM_IN);
  fields_out = splatsim_unit_fields(unit, SPLATSIM_OUT);
  if (fields_in < 1 || fields_in > 32 || fields_out < 1 || fields_out > 32 || splatsim_unit_fields(unit, 9) != -1) goto end;
  for (i = 0; i < 200; i++) {
    if (splatsim_unit_random(unit, in, (size_t)fields_in) != 0 || splatsim_unit_step(unit, in, (size_t)fields_in) < 0) goto end;
    if (splatsim_unit_random_bits(other, bits, 32) != 0 || splatsim_unit_step_bits(other, bits, 32) < 0) goto end;
    while (splatsim_unit_next(unit, SPLATSIM_OUT, out, (size_t)fields_out) == 1) {
      if (splatsim_unit_compare(other, SPLATSIM_OUT, out, (size_t)fields_out) != 0) goto end;
      compared++;
    }
  }
  if (bits_and_ends(unit, other, name) != 0) goto end;
  /* A device with a wrong record: detected as soon as the changed field has a meaning. */
  for (i = 0; i < 100 && differs == 0; i++) {
    if (splatsim_unit_random(unit, in, (size_t)fields_in) != 0) goto end;
    if (splatsim_unit_step(unit, in, (size_t)fields_in) < 0 || splatsim_unit_step(other, in, (size_t)fields_in) < 0) goto end;
    while (differs == 0 && splatsim_unit_next(unit, SPLATSIM_OUT, out, (size_t)fields_out) == 1) {
      out[fields_out - 1] ^= 1;
      differs = splatsim_unit_compare(other, SPLATSIM_OUT, out, (size_t)fields_out);
    }
  }
  if (differs != 1) goto end;
  printf("%s: %ld records are equal; %s\n", name, compared, splatsim_last_error());
  failed = compared < 50;
end:
  if (failed) fail(name);
  splatsim_unit_free(unit);
  splatsim_unit_free(other);
  return failed;
}

/* Every error is reported in a sentence. */
static int refusals(splatsim_machine *machine, const splatsim_scene *scene) {
  splatsim_unit *gauss = splatsim_unit_new(machine, scene, "gauss", 1);
  const int64_t far_out[2] = {-1, 1};
  int64_t words[2] = {0, 0};
  uint32_t half = 0;
  int failures = 0;
  char name[16];
#define EXPECT(call, text)                                                        \
  do {                                                                            \
    if (!(call) || strstr(splatsim_last_error(), text) == NULL) {                 \
      fprintf(stderr, "%s: not refused: %s\n", #call, splatsim_last_error());     \
      failures++;                                                                 \
    }                                                                             \
  } while (0)
  EXPECT(splatsim_machine_open(NULL) == NULL, "name_or_path is NULL");
  EXPECT(splatsim_machine_open("nowhere") == NULL, "nowhere");
  EXPECT(splatsim_machine_from_json("{", 1) == NULL, "not JSON");
  EXPECT(splatsim_machine_from_json(NULL, 1) == NULL, "json is NULL");
  EXPECT(splatsim_machine_from_json("{\"gauss\": 1}", 12) == NULL, "the machine");
  EXPECT(splatsim_machine_set(machine, "gauss.weight") == -1, "gauss.weight");
  EXPECT(splatsim_machine_set(machine, "gauss.wait=U-2F12") == -1, "wait");
  EXPECT(splatsim_scene_open("nowhere.json", 0, 0) == NULL, "nowhere.json");
  EXPECT(splatsim_draw(NULL, scene) == NULL, "machine is NULL");
  EXPECT(splatsim_draw(machine, NULL) == NULL, "scene is NULL");
  EXPECT(splatsim_unit_new(machine, scene, "gaus", 1) == NULL, "no such unit");
  EXPECT(splatsim_unit_new(machine, scene, NULL, 1) == NULL, "name is NULL");
  EXPECT(splatsim_unit_step(NULL, words, 2) == -1, "unit is NULL");
  EXPECT(splatsim_unit_step(gauss, NULL, 2) == -1, "words is NULL");
  EXPECT(splatsim_unit_step(gauss, words, 1) == -1, "1 words");
  EXPECT(splatsim_unit_step(gauss, far_out, 2) == -1, "radial");
  EXPECT(splatsim_unit_step_bits(gauss, &half, 0) == -1, "0 words");
  EXPECT(splatsim_unit_next(gauss, SPLATSIM_OUT, words, 2) == -1, "count is 2");
  EXPECT(splatsim_unit_next(gauss, SPLATSIM_HELD, words, 2) == -1, "no port 4");
  EXPECT(splatsim_unit_compare(gauss, SPLATSIM_OUT, words, 1) == 1, "one too many");
  EXPECT(splatsim_unit_step(gauss, words, 2) == 1 && splatsim_unit_compare(gauss, SPLATSIM_OUT, words, 2) == -1, "count is 2");
  EXPECT(splatsim_unit_compare_bits(gauss, SPLATSIM_OUT, &half, 0) == -1, "0 words");
  EXPECT(splatsim_unit_next(gauss, SPLATSIM_OUT, (int64_t *)(void *)((char *)words + 1), 1) == -1, "not aligned");
  EXPECT(splatsim_unit_step(gauss, words, (size_t)-1) == -1, "more than memory");
  /* The refused calls removed no record. */
  if (splatsim_unit_waiting(gauss, SPLATSIM_OUT) != 1 || splatsim_unit_next(gauss, SPLATSIM_OUT, words, 1) != 1) failures++;
  EXPECT(splatsim_unit_constant_bits(gauss, "lamp", 0, &half, 1) == -1, "lamp");
  EXPECT(splatsim_unit_constant_bits(gauss, "frame", 0, &half, 1) == -1, "count is 1");
#undef EXPECT
  if (splatsim_unit_next(gauss, SPLATSIM_OUT, words, 1) != 0) failures++;
  if (splatsim_unit_field(gauss, SPLATSIM_IN, 0, name, sizeof name) != 6 || strcmp(name, "radial") != 0) failures++;
  splatsim_unit_free(gauss);
  splatsim_unit_free(NULL);
  splatsim_scene_free(NULL);
  splatsim_machine_free(NULL);
  splatsim_drawing_free(NULL);
  return failures;
}

int main(int argc, char **argv) {
  static const char *const units[] = {"project", "ellipse", "raster", "gauss", "fragment", "shade", "resolve"};
  splatsim_machine *machine = NULL, *again = NULL;
  splatsim_scene *scene = NULL;
  char *json = NULL;
  ptrdiff_t length;
  size_t i;
  int failures = 0, argument;
  if (argc < 2) {
    fprintf(stderr, "usage: units SCENE.json [UNIT...]\n");
    return 2;
  }
  printf("splatsim %s\n", splatsim_version());
  machine = splatsim_machine_open("tiny");
  scene = splatsim_scene_open(argv[1], 0, 0);
  if (machine == NULL || scene == NULL || splatsim_machine_set(machine, "fragment.layers=3") != 0) {
    failures = fail("machine and scene");
    goto end;
  }
  /* A machine from its text. */
  length = splatsim_machine_json(machine, NULL, 0);
  json = length < 0 ? NULL : malloc((size_t)length + 1);
  if (json == NULL || splatsim_machine_json(machine, json, (size_t)length + 1) != length) {
    failures = fail("machine as JSON");
    goto end;
  }
  again = splatsim_machine_from_json(json, (size_t)length);
  if (again == NULL) {
    failures = fail("machine from JSON");
    goto end;
  }
  failures += draw(again, scene);
  for (argument = 2; argument < argc; argument++) failures += compare(again, scene, argv[argument]);
  for (i = 0; argc == 2 && i < sizeof units / sizeof *units; i++) failures += compare(again, scene, units[i]);
  failures += refusals(machine, scene);
end:
  free(json);
  splatsim_machine_free(again);
  splatsim_machine_free(machine);
  splatsim_scene_free(scene);
  printf("%s\n", failures == 0 ? "all well" : "failed");
  return failures != 0;
}
