"""splatsim for Python: units of a machine that answer record by record, over the C library.

The library is looked for as SPLATSIM_LIBRARY, beside this file, and where the system looks.
"""

import ctypes
import os
from pathlib import Path

PORTS = {"in": 0, "out": 1, "request": 2, "answer": 3, "held": 4}


class SplatsimError(ValueError):
    """What is wrong, in a sentence."""


def _load():
    beside = Path(__file__).parent / "libsplatsim_c.so"
    name = os.environ.get("SPLATSIM_LIBRARY") or (str(beside) if beside.exists() else "libsplatsim_c.so")
    library = ctypes.CDLL(name)
    handle, words, number, size = ctypes.c_void_p, ctypes.POINTER(ctypes.c_int64), ctypes.c_int, ctypes.c_size_t
    for function, result, arguments in [
        ("last_error", ctypes.c_char_p, []),
        ("machine_open", handle, [ctypes.c_char_p]),
        ("machine_set", number, [handle, ctypes.c_char_p]),
        ("machine_free", None, [handle]),
        ("scene_open", handle, [ctypes.c_char_p, ctypes.c_uint32, ctypes.c_uint32]),
        ("scene_free", None, [handle]),
        ("unit_new", handle, [handle, handle, ctypes.c_char_p, ctypes.c_uint64]),
        ("unit_free", None, [handle]),
        ("unit_fields", ctypes.c_ssize_t, [handle, number]),
        ("unit_field", ctypes.c_ssize_t, [handle, number, size, ctypes.c_char_p, size]),
        ("unit_step", ctypes.c_ssize_t, [handle, words, size]),
        ("unit_end", ctypes.c_ssize_t, [handle]),
        ("unit_waiting", ctypes.c_ssize_t, [handle, number]),
        ("unit_next", number, [handle, number, words, size]),
        ("unit_compare", number, [handle, number, words, size]),
        ("unit_random", number, [handle, words, size]),
    ]:
        entry = getattr(library, "splatsim_" + function)
        entry.restype, entry.argtypes = result, arguments
    return library


_LIBRARY = None


def _call(function, *arguments, fails=lambda result: result is None):
    global _LIBRARY
    if _LIBRARY is None:
        _LIBRARY = _load()
    result = getattr(_LIBRARY, "splatsim_" + function)(*arguments)
    if fails(result):
        raise SplatsimError(_LIBRARY.splatsim_last_error().decode())
    return result


def _negative(result):
    return result < 0


def _within(number, least, greatest, what):
    if not least <= number <= greatest:
        raise SplatsimError(f"{what} is {number}, and {least} to {greatest} are possible")
    return number


class Unit:
    """One unit of a machine by itself: records in, records out, each a dict of whole numbers by field.

    machine, scene: names or files; settings: changes such as "gauss.weight=U-2F12"; size: columns and rows, or those of the scene; seed: of
    `random`.
    """

    def __init__(self, name, machine="reference", scene="glass-spheres", settings=(), size=(0, 0), seed=1):
        self._handle = None
        size = [_within(pixels, 0, 2**32 - 1, "size") for pixels in size]
        seed = _within(seed, 0, 2**64 - 1, "seed")
        of_machine = _call("machine_open", os.fsencode(machine))
        try:
            for setting in settings:
                _call("machine_set", of_machine, setting.encode(), fails=_negative)
            of_scene = _call("scene_open", os.fsencode(scene), *size)
            try:
                self._handle = _call("unit_new", of_machine, of_scene, name.encode(), seed)
            finally:
                _call("scene_free", of_scene, fails=lambda _: False)
        finally:
            _call("machine_free", of_machine, fails=lambda _: False)
        self.name = name
        self._fields = {}

    def __del__(self):
        if getattr(self, "_handle", None):
            _call("unit_free", self._handle, fails=lambda _: False)
            self._handle = None

    def fields(self, port="in"):
        """Names of a port's fields."""
        if port not in self._fields:
            number = PORTS[port]
            count = _call("unit_fields", self._handle, number, fails=_negative)
            names = []
            for field in range(count):
                length = _call("unit_field", self._handle, number, field, None, 0, fails=_negative)
                text = ctypes.create_string_buffer(length + 1)
                _call("unit_field", self._handle, number, field, text, length + 1, fails=_negative)
                names.append(text.value.decode())
            self._fields[port] = names
        return self._fields[port]

    def _words(self, port, record=None):
        names = self.fields(port)
        if record is not None and set(record) != set(names):
            odd = sorted(set(record) ^ set(names))
            raise SplatsimError(f"{self.name}.{port}: {', '.join(odd)}: a record has {', '.join(names)}, each once")
        numbers = [] if record is None else [_within(record[name], -(2**63), 2**63 - 1, f"{self.name}.{port}: {name}") for name in names]
        return (ctypes.c_int64 * len(names))(*numbers)

    def _take(self, port):
        words = self._words(port)
        while _call("unit_next", self._handle, PORTS[port], words, len(words), fails=_negative):
            yield dict(zip(self.fields(port), words))

    def step(self, record):
        """Gives the unit a record; the records that it gives for that."""
        self.give(record)
        return list(self._take("out"))

    def give(self, record):
        """Gives the unit a record. What it gives for that waits, for `take` or `compare`."""
        words = self._words("in", record)
        _call("unit_step", self._handle, words, len(words), fails=_negative)

    def take(self, port="out"):
        """The records that wait at a port."""
        return list(self._take(port))

    def end(self):
        """Ends a frame: fragment gives what it holds (port "held"), sort what it has sorted."""
        _call("unit_end", self._handle, fails=_negative)

    def waiting(self, port="out"):
        """Number of records that wait at a port."""
        return _call("unit_waiting", self._handle, PORTS[port], fails=_negative)

    def compare(self, record, port="out"):
        """Takes the record that waits away; None if a device's is equal, else what is different, in a sentence."""
        words = self._words(port, record)
        differs = _call("unit_compare", self._handle, PORTS[port], words, len(words), fails=_negative)
        return _LIBRARY.splatsim_last_error().decode() if differs else None

    def random(self):
        """A record that the unit may be given: corners and thresholds on purpose, then random ones, for ever."""
        words = self._words("in")
        _call("unit_random", self._handle, words, len(words), fails=_negative)
        return dict(zip(self.fields("in"), words))
