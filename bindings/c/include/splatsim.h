/* splatsim for C and C++. Made by cbindgen; SPLATSIM_WRITE_HEADER=1 cargo test -p splatsim-c writes it. */

#ifndef SPLATSIM_H
#define SPLATSIM_H

#include <stddef.h>
#include <stdint.h>

/*
 Picture of the hardware.
 */
#define SPLATSIM_FIXED 0

/*
 Picture by the same rules in exact arithmetic.
 */
#define SPLATSIM_GOLDEN 1

/*
 Picture in exact arithmetic without a limit of fragments.
 */
#define SPLATSIM_IDEAL 2

/*
 Port: input records of a unit.
 */
#define SPLATSIM_IN 0

/*
 Port: output records of a unit.
 */
#define SPLATSIM_OUT 1

/*
 Port: requests of fragment to shade.
 */
#define SPLATSIM_REQUEST 2

/*
 Port: responses of shade to fragment.
 */
#define SPLATSIM_ANSWER 3

/*
 Port: final contents of fragment's pixels.
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
 A unit by itself, and its output records that have not been read.
 */
typedef struct splatsim_unit splatsim_unit;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Opens a named machine, such as "reference", or a machine file. NULL on failure.

 # Safety
 `name_or_path` is NULL or a string that ends in 0.
 */
splatsim_machine *splatsim_machine_open(const char *name_or_path);

/*
 Makes the machine of a JSON text of `length` bytes, as in a machine file. NULL if it is not a
 machine.

 # Safety
 `json` is NULL or points to `length` bytes.
 */
splatsim_machine *splatsim_machine_from_json(const char *json, size_t length);

/*
 Changes a field, as in "gauss.weight=U-2F12". 0, or -1 for an unknown field or an invalid value:
 the machine is unchanged then. Existing units and drawings keep the machine that they were made
 with.

 # Safety
 `machine` is NULL or a machine, `setting` NULL or a string that ends in 0.
 */
int splatsim_machine_set(splatsim_machine *machine, const char *setting);

/*
 Writes the machine as JSON, with a terminating 0, into `text` if `capacity` is greater than the
 returned count: bytes without the 0. -1 on failure.

 # Safety
 `machine` is NULL or a machine; `text` is NULL, with capacity 0, or has room for `capacity`
 bytes.
 */
ptrdiff_t splatsim_machine_json(const splatsim_machine *machine, char *text, size_t capacity);

/*
 Frees a machine; does nothing for NULL.

 # Safety
 `machine` is NULL or a machine that is not used any more.
 */
void splatsim_machine_free(splatsim_machine *machine);

/*
 Opens a scene file, a cloud, a volume or a built-in scene, such as "glass-spheres". `width` and
 `height` are the size of the picture; if one is 0, the scene's own size is used. NULL if it
 cannot be read.

 # Safety
 `name_or_path` is NULL or a string that ends in 0.
 */
splatsim_scene *splatsim_scene_open(const char *name_or_path, uint32_t width, uint32_t height);

/*
 Frees a scene; does nothing for NULL.

 # Safety
 `scene` is NULL or a scene that is not used any more.
 */
void splatsim_scene_free(splatsim_scene *scene);

/*
 Draws a scene on a machine and in exact arithmetic. NULL if a register of the machine cannot
 hold a value of the scene.

 # Safety
 Both are NULL or of their types.
 */
splatsim_drawing *splatsim_draw(const splatsim_machine *machine, const splatsim_scene *scene);

/*
 Columns and rows of the pictures. 0, or -1 on failure.

 # Safety
 `drawing` is NULL or a drawing, `width` and `height` NULL or writable.
 */
int splatsim_drawing_size(const splatsim_drawing *drawing, uint32_t *width, uint32_t *height);

/*
 Writes one of the pictures, such as SPLATSIM_FIXED, into `rgba`: linear light, premultiplied,
 four numbers per pixel, row by row from the top. `count` must be 4 * width * height. 0, or -1 on
 failure.

 # Safety
 `drawing` is NULL or a drawing, `rgba` NULL or writable for `count` numbers, without other users
 during the call.
 */
int splatsim_picture(const splatsim_drawing *drawing, int which, double *rgba, size_t count);

/*
 Writes the report as JSON, as in `report.json`, with a terminating 0, into `text` if `capacity`
 is greater than the returned count: bytes without the 0. -1 on failure.

 # Safety
 `drawing` is NULL or a drawing; `text` is NULL, with capacity 0, or has room for `capacity`
 bytes.
 */
ptrdiff_t splatsim_report_json(const splatsim_drawing *drawing, char *text, size_t capacity);

/*
 Frees a drawing; does nothing for NULL.

 # Safety
 `drawing` is NULL or a drawing that is not used any more.
 */
void splatsim_drawing_free(splatsim_drawing *drawing);

/*
 The last error of this thread, in a sentence; empty if there was none. It is valid until the
 thread's next failure.
 */
const char *splatsim_last_error(void);

/*
 The version, such as 0.1.0.
 */
const char *splatsim_version(void);

/*
 Makes the unit of a machine with a name, such as "raster", with registers, lights and materials
 of a scene. Random records depend on `seed`. NULL for an unknown unit. Machine and scene may be
 freed before the unit.

 # Safety
 All are NULL or of their types.
 */
splatsim_unit *splatsim_unit_new(const splatsim_machine *machine,
                                 const splatsim_scene *scene,
                                 const char *name,
                                 uint64_t seed);

/*
 Frees a unit; does nothing for NULL.

 # Safety
 `unit` is NULL or a unit that is not used any more.
 */
void splatsim_unit_free(splatsim_unit *unit);

/*
 Words in a record of a port, such as SPLATSIM_IN: one per field. -1 if the unit does not have
 the port.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_fields(const splatsim_unit *unit, int port);

/*
 Bits in a record of a port. -1 if the unit does not have the port.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_width(const splatsim_unit *unit, int port);

/*
 Writes a field's name, with a terminating 0, into `text` if `capacity` is greater than the
 returned count: bytes without the 0. -1 on failure.

 # Safety
 `unit` is NULL or a unit; `text` is NULL, with capacity 0, or has room for `capacity` bytes.
 */
ptrdiff_t splatsim_unit_field(const splatsim_unit *unit, int port, size_t field, char *text, size_t capacity);

/*
 Passes a record to the unit, one word per field. The output is queued at every port until it is
 read (`splatsim_unit_next`) or compared. This includes fragment's requests and responses, whose
 queues grow if they are not read. Returns the number of queued records at SPLATSIM_OUT, or -1
 for an invalid record: the unit is unchanged then.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a pointer to `count` initialised words that do not
 change during the call.
 */
ptrdiff_t splatsim_unit_step(splatsim_unit *unit, const int64_t *words, size_t count);

/*
 `splatsim_unit_step` for a record in 32-bit words, as in a line of a trace, the least
 significant first.

 # Safety
 As `splatsim_unit_step`.
 */
ptrdiff_t splatsim_unit_step_bits(splatsim_unit *unit, const uint32_t *words, size_t count);

/*
 Ends a frame: fragment outputs its pixels' contents, sort the sorted records, and both are
 empty. Returns the number of queued records at SPLATSIM_OUT and SPLATSIM_HELD, or -1 if the last
 layer of a pixel is missing.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_end(splatsim_unit *unit);

/*
 Number of queued records at a port. -1 on failure.

 # Safety
 `unit` is NULL or a unit.
 */
ptrdiff_t splatsim_unit_waiting(const splatsim_unit *unit, int port);

/*
 Removes the oldest queued record at a port. `count` must be its number of fields. 1, or 0 if the
 queue is empty, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `words` NULL or writable for `count` words, without other users during
 the call.
 */
int splatsim_unit_next(splatsim_unit *unit, int port, int64_t *words, size_t count);

/*
 `splatsim_unit_next` in 32-bit words, the least significant first; 0 above the record.

 # Safety
 As `splatsim_unit_next`.
 */
int splatsim_unit_next_bits(splatsim_unit *unit, int port, uint32_t *words, size_t count);

/*
 Compares a device's record with the oldest queued record at a port, and removes that. Where only
 the order per pixel matters, it is the oldest record of the same pixel. `count` must be its
 number of fields. Fields without meaning in a record are not compared. 0 if they are equal; 1 if
 they differ: `splatsim_last_error` returns the difference; -1 on failure: nothing is removed
 then.

 # Safety
 `unit` is NULL or a unit, `words` NULL or a pointer to `count` initialised words that do not
 change during the call.
 */
int splatsim_unit_compare(splatsim_unit *unit, int port, const int64_t *words, size_t count);

/*
 `splatsim_unit_compare` for a record in 32-bit words, the least significant first.

 # Safety
 As `splatsim_unit_compare`.
 */
int splatsim_unit_compare_bits(splatsim_unit *unit, int port, const uint32_t *words, size_t count);

/*
 Makes a valid random input record: first corner cases and thresholds, then random ones, without
 end. `count` must be its number of fields. 0, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `words` NULL or writable for `count` words, without other users during
 the call.
 */
int splatsim_unit_random(splatsim_unit *unit, int64_t *words, size_t count);

/*
 `splatsim_unit_random` in 32-bit words, the least significant first; 0 above the record.

 # Safety
 As `splatsim_unit_random`.
 */
int splatsim_unit_random_bits(splatsim_unit *unit, uint32_t *words, size_t count);

/*
 Writes record `number` of a constant of a frame ("frame", "light", "material" or "reflection")
 in 32-bit words, the least significant first; 0 above the record. 1, or 0 if there is no record
 of this number, or -1 on failure.

 # Safety
 `unit` is NULL or a unit, `name` NULL or a string that ends in 0, `words` NULL or writable for
 `count` words, without other users during the call.
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
