/* splatsim for C and C++. Made by cbindgen: `cargo test -p splatsim-c` says how to make it anew. */

#ifndef SPLATSIM_H
#define SPLATSIM_H

#include <stddef.h>
#include <stdint.h>

/*
 What the hardware draws.
 */
#define SPLATSIM_FIXED 0

/*
 The same rules in exact arithmetic.
 */
#define SPLATSIM_GOLDEN 1

/*
 Exact arithmetic without a limit of fragments.
 */
#define SPLATSIM_IDEAL 2

/*
 Port: what a unit takes.
 */
#define SPLATSIM_IN 0

/*
 Port: what it gives for that.
 */
#define SPLATSIM_OUT 1

/*
 Port: what fragment asks shade.
 */
#define SPLATSIM_REQUEST 2

/*
 Port: what that says.
 */
#define SPLATSIM_ANSWER 3

/*
 Port: what fragment holds in the end.
 */
#define SPLATSIM_HELD 4

/*
 Three pictures of a scene, and the report.
 */
typedef struct splatsim_drawing splatsim_drawing;

/*
 A machine.
 */
typedef struct splatsim_machine splatsim_machine;

/*
 A scene.
 */
typedef struct splatsim_scene splatsim_scene;

/*
 A unit by itself, and the records that it gave and nobody has taken.
 */
typedef struct splatsim_unit splatsim_unit;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 A named machine, such as "reference", or that of a file. NULL where there is none.

 # Safety
 `name_or_path` is NULL or a string that ends in 0.
 */
splatsim_machine *splatsim_machine_open(const char *name_or_path);

/*
 The machine that a JSON text of `length` bytes describes, as a machine file does. NULL where it
 describes none.

 # Safety
 `json` is NULL or points to `length` bytes.
 */
splatsim_machine *splatsim_machine_from_json(const char *json, size_t length);

/*
 Changes a field, as in "gauss.weight=U-2F12". 0, or -1 where the machine has no such field or
 cannot be built with it: it then stays as it was. Units and drawings that were made before keep
 the machine that they were made with.

 # Safety
 `machine` is NULL or a machine, `setting` NULL or a string that ends in 0.
 */
int splatsim_machine_set(splatsim_machine *machine, const char *setting);

/*
 Writes the machine as JSON, and a 0, into `text` if `capacity` is greater than the count that is
 returned: bytes without the 0. -1 on failure.

 # Safety
 `machine` is NULL or a machine; `text` is NULL, with capacity 0, or has room for `capacity`
 bytes.
 */
ptrdiff_t splatsim_machine_json(const splatsim_machine *machine, char *text, size_t capacity);

/*
 Frees a machine; NULL is nothing.

 # Safety
 `machine` is NULL or a machine, and used by nobody any more.
 */
void splatsim_machine_free(splatsim_machine *machine);

/*
 A scene's file, a cloud, a volume or a built-in name, such as "glass-spheres"; in a picture of
 so many columns and rows, or, where one is 0, of its own size. NULL where it cannot be read.

 # Safety
 `name_or_path` is NULL or a string that ends in 0.
 */
splatsim_scene *splatsim_scene_open(const char *name_or_path, uint32_t width, uint32_t height);

/*
 Frees a scene; NULL is nothing.

 # Safety
 `scene` is NULL or a scene, and used by nobody any more.
 */
void splatsim_scene_free(splatsim_scene *scene);

/*
 Draws a scene on a machine and in exact arithmetic. NULL where the machine cannot hold it.

 # Safety
 Both are NULL or what their types say.
 */
splatsim_drawing *splatsim_draw(const splatsim_machine *machine, const splatsim_scene *scene);

/*
 Columns and rows of the pictures. 0, or -1 on failure.

 # Safety
 `drawing` is NULL or a drawing, `width` and `height` NULL or places for a number each.
 */
int splatsim_drawing_size(const splatsim_drawing *drawing, uint32_t *width, uint32_t *height);

/*
 Writes one of the pictures, SPLATSIM_FIXED and so on, into `rgba`: linear light, premultiplied,
 four numbers a pixel, row by row from the top. `count` must be 4 * width * height. 0, or -1 on
 failure.

 # Safety
 `drawing` is NULL or a drawing, `rgba` NULL or a place for `count` numbers, which nobody else
 uses meanwhile.
 */
int splatsim_picture(const splatsim_drawing *drawing, int which, double *rgba, size_t count);

/*
 Writes the report as JSON, as `report.json` has it, and a 0, into `text` if `capacity` is
 greater than the count that is returned: bytes without the 0. -1 on failure.

 # Safety
 `drawing` is NULL or a drawing; `text` is NULL, with capacity 0, or has room for `capacity`
 bytes.
 */
ptrdiff_t splatsim_report_json(const splatsim_drawing *drawing, char *text, size_t capacity);

/*
 Frees a drawing; NULL is nothing.

 # Safety
 `drawing` is NULL or a drawing, and used by nobody any more.
 */
void splatsim_drawing_free(splatsim_drawing *drawing);

/*
 What went wrong last in this thread, in a sentence; empty if nothing has. It stays until the
 thread's next failure.
 */
const char *splatsim_last_error(void);

/*
 The version, such as 0.1.0.
 */
const char *splatsim_version(void);

/*
 The unit of a machine by its name, such as "raster", with registers, lights and materials of a
 scene. Random records depend on `seed`. NULL where there is no such unit. Machine and scene may
 be freed before it is.

 # Safety
 All are NULL or what their types say.
 */
splatsim_unit *splatsim_unit_new(const splatsim_machine *machine,
                                 const splatsim_scene *scene,
                                 const char *name,
                                 uint64_t seed);

/*
 Frees a unit; NULL is nothing.

 # Safety
 `unit` is NULL or a unit, and used by nobody any more.
 */
void splatsim_unit_free(splatsim_unit *unit);

/*
 Words of a record of a port, SPLATSIM_IN and so on: one for each field. -1 where the unit has no
 such port.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_fields(const splatsim_unit *unit, int port);

/*
 Bits of a record of a port. -1 where the unit has no such port.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_width(const splatsim_unit *unit, int port);

/*
 Writes a field's name, and a 0, into `text` if `capacity` is greater than the count that is
 returned: bytes without the 0. -1 on failure.

 # Safety
 `unit` is NULL or a unit; `text` is NULL, with capacity 0, or has room for `capacity` bytes.
 */
ptrdiff_t splatsim_unit_field(const splatsim_unit *unit, int port, size_t field, char *text, size_t capacity);

/*
 Gives the unit a record, a word for each field. What comes of it waits until it is taken
 (`splatsim_unit_next`) or compared, at every port: fragment's requests and answers too, which
 grow in number where nobody takes them. The number of records that wait at SPLATSIM_OUT, or -1
 where the unit was never given such a record: nothing has happened then.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a pointer to `count` words that were written, which
 nobody changes meanwhile.
 */
ptrdiff_t splatsim_unit_step(splatsim_unit *unit, const int64_t *words, size_t count);

/*
 The same with a record as a trace's line has it, in 32-bit words, the least significant first.

 # Safety
 As `splatsim_unit_step`.
 */
ptrdiff_t splatsim_unit_step_bits(splatsim_unit *unit, const uint32_t *words, size_t count);

/*
 Ends a frame: fragment gives what it holds, sort what it has sorted, and both are empty. The
 number of records that wait at SPLATSIM_OUT and SPLATSIM_HELD, or -1 where a pixel's last layer
 is missing.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_end(splatsim_unit *unit);

/*
 Number of records that wait at a port. -1 on failure.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_waiting(const splatsim_unit *unit, int port);

/*
 Takes the record that has waited longest at a port. `count` must be its number of fields. 1, or
 0 where none waits, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a place for `count` words, which nobody else uses
 meanwhile.
 */
int splatsim_unit_next(splatsim_unit *unit, int port, int64_t *words, size_t count);

/*
 The same as 32-bit words, the least significant first; 0 above the record.

 # Safety
 As `splatsim_unit_next`.
 */
int splatsim_unit_next_bits(splatsim_unit *unit, int port, uint32_t *words, size_t count);

/*
 Compares a device's record with the one that has waited longest at a port (where order counts at
 each pixel only, at its pixel), and takes that away. `count` must be its number of fields. What
 means nothing in a record is not compared. 0 where they are equal, 1 where they differ:
 `splatsim_last_error` says how; -1 on failure: nothing is taken then.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a pointer to `count` words that were written, which
 nobody changes meanwhile.
 */
int splatsim_unit_compare(splatsim_unit *unit, int port, const int64_t *words, size_t count);

/*
 The same with a record in 32-bit words, the least significant first.

 # Safety
 As `splatsim_unit_compare`.
 */
int splatsim_unit_compare_bits(splatsim_unit *unit, int port, const uint32_t *words, size_t count);

/*
 Makes up a record that the unit may be given: corners and thresholds on purpose, then random
 ones, for ever. `count` must be its number of fields. 0, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a place for `count` words, which nobody else uses
 meanwhile.
 */
int splatsim_unit_random(splatsim_unit *unit, int64_t *words, size_t count);

/*
 The same as 32-bit words, the least significant first; 0 above the record.

 # Safety
 As `splatsim_unit_random`.
 */
int splatsim_unit_random_bits(splatsim_unit *unit, uint32_t *words, size_t count);

/*
 Record `number` of what is constant in a frame ("frame", "light", "material" or "reflection"),
 as 32-bit words, the least significant first; 0 above the record. 1, or 0 where there is none of
 this number, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `name` NULL or a string that ends in 0, `words` NULL or a place for
 `count` words, which nobody else uses meanwhile.
 */
int splatsim_unit_constant_bits(const splatsim_unit *unit,
                                const char *name,
                                size_t number,
                                uint32_t *words,
                                size_t count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SPLATSIM_H */
