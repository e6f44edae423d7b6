"""Units: one unit of a machine by itself, record by record or array by array."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from splatsim import _native
from splatsim._frame import AnyMachine, AnyScene
from splatsim._models import Machine, Scene
from splatsim._native import SplatsimError

Record = dict[str, int]


class Answers(dict[str, NDArray[np.int64]]):
    """Output of a unit, one array per field; `counts` is the number of output records for each input record."""

    counts: NDArray[np.int64]


class Unit:
    """One unit of a machine by itself: records in, records out, each a dict of whole numbers by field.

    machine: the default is the scene's default machine; settings: changes such as "gauss.weight=U-2F12"; size: columns and rows, by default
    those of the scene; seed: for `random`.
    """

    def __init__(
        self,
        name: str,
        machine: AnyMachine = None,
        scene: AnyScene = "glass-spheres",
        settings: Sequence[str] = (),
        size: tuple[int, int] | None = None,
        seed: int = 1,
    ) -> None:
        of = scene._own if isinstance(scene, Scene) else Scene(scene, size=size)._own
        on = Machine(of.usual_machine if machine is None else machine).with_settings(*settings)
        self.name = name
        self._own = _native.Unit(name, on._own, of, _within(seed, 0, 2**64 - 1, "seed"))
        self._fields: dict[str, list[str]] = {}

    def fields(self, port: str = "in") -> list[str]:
        """Names of a port's fields."""
        if port not in self._fields:
            self._fields[port] = self._own.fields(port)
        return self._fields[port]

    def registers(self, name: str) -> list[Record]:
        """The records of a constant of a frame: frame, light, material, reflection."""
        names, records = self._own.registers(name)
        return [dict(zip(names, words, strict=True)) for words in records]

    def _words(self, port: str, record: Mapping[str, int]) -> list[int]:
        names = self.fields(port)
        if set(record) != set(names):
            odd = sorted(set(record) ^ set(names))
            raise SplatsimError(f"{self.name}.{port}: {', '.join(odd)}: a record has {', '.join(names)}, each once")
        return [_within(record[name], -(2**63), 2**63 - 1, f"{self.name}.{port}: {name}") for name in names]

    def step(self, record: Mapping[str, int]) -> list[Record]:
        """Passes a record to the unit; returns its output records."""
        self.give(record)
        return self.take("out")

    def give(self, record: Mapping[str, int]) -> None:
        """Passes a record to the unit. Its output is queued for `take` or `compare`."""
        self._own.give(self._words("in", record))

    def take(self, port: str = "out") -> list[Record]:
        """Removes and returns the queued records of a port."""
        names = self.fields(port)
        return [dict(zip(names, words, strict=True)) for words in self._own.take(port)]

    def end(self) -> None:
        """Ends a frame: fragment outputs its pixels' contents (port "held"), sort the sorted records."""
        self._own.end()

    def waiting(self, port: str = "out") -> int:
        """Number of queued records at a port."""
        return self._own.waiting(port)

    def compare(self, record: Mapping[str, int], port: str = "out") -> str | None:
        """Removes the oldest queued record; None if a device's record is equal, else the difference, in a sentence."""
        return self._own.compare(port, self._words(port, record))

    def random(self) -> Record:
        """A valid random input record: first corner cases and thresholds, then random ones, without end."""
        return dict(zip(self.fields("in"), self._own.random(), strict=True))

    def map(self, **fields: ArrayLike) -> Answers:
        """Passes a record to the unit for each element of arrays of whole numbers, one array per field; returns the output fields as arrays."""
        names = self.fields("in")
        if set(fields) != set(names):
            odd = sorted(set(fields) ^ set(names))
            raise SplatsimError(f"{self.name}.in: {', '.join(odd)}: a record has {', '.join(names)}, each once")
        columns = np.broadcast_arrays(*(self._column(name, fields[name]) for name in names))
        words = np.ascontiguousarray(np.stack([column.reshape(-1) for column in columns], axis=1))
        counts, out = self._own.map(words.reshape(-1), len(names))
        given = self.fields("out")
        rows = np.frombuffer(out, np.int64).reshape(-1, len(given))
        answers = Answers({name: rows[:, nth] for nth, name in enumerate(given)})
        answers.counts = np.frombuffer(counts, np.int64)
        return answers

    def _column(self, name: str, values: ArrayLike) -> NDArray[np.int64]:
        given = np.asarray(values)
        if not np.issubdtype(given.dtype, np.integer):
            raise SplatsimError(f"{self.name}.in: {name} is of {given.dtype}: it must be whole numbers of at most 64 bits")
        if given.dtype == np.uint64 and given.size and given.max() > 2**63 - 1:
            raise SplatsimError(f"{self.name}.in: {name} is {given.max()}: it can be at most {2**63 - 1}")
        return given.astype(np.int64)


def _within(number: int, least: int, greatest: int, what: str) -> int:
    if not least <= number <= greatest:
        raise SplatsimError(f"{what} is {number}: it can be {least} to {greatest}")
    return number


