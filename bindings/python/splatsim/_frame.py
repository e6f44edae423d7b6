"""Frames: drawn, recorded and replayed, explained, traced."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from splatsim import _native
from splatsim._models import Machine, Named, Scene, as_json, of_machine, of_scene
from splatsim._report import Node, Progress, shown, table

AnyScene = Scene | Named | Mapping[str, Any]
AnyMachine = Machine | Named | Mapping[str, Any] | None
#: Fields of timing, and the values of each.
Timing = Mapping[str, Sequence[Any]]


class Frame:
    """A drawn frame: three pictures, their difference, and the report."""

    def __init__(self, native: _native.Outcome) -> None:
        self._own = native

    def _picture(self, which: str) -> NDArray[np.float64]:
        columns, rows = self._own.size
        return np.frombuffer(self._own.picture(which), np.float64).reshape(rows, columns, 4)

    @cached_property
    def fixed(self) -> NDArray[np.float64]:
        """Picture of the hardware: rows, columns, RGBA; linear light, premultiplied by alpha."""
        return self._picture("fixed")

    @cached_property
    def golden(self) -> NDArray[np.float64]:
        """Picture by the same rules in exact arithmetic."""
        return self._picture("golden")

    @cached_property
    def ideal(self) -> NDArray[np.float64]:
        """Picture in exact arithmetic without a limit of layers."""
        return self._picture("ideal")

    @cached_property
    def error(self) -> NDArray[np.float64]:
        """|fixed − golden|, times `report.error_scale`."""
        return self._picture("error")

    @cached_property
    def report(self) -> Node:
        """The report, as in `report.json`."""
        return Node(json.loads(self._own.report()))

    @cached_property
    def signals(self) -> pa.Table:
        """One row per signal: its range, and the values outside of it."""
        return table(self.report.dict()["signals"])

    @cached_property
    def cycles(self) -> pa.Table:
        """One row per unit: its cycles by cause."""
        return table(self.report.dict()["cycles"]["units"])

    def summary(self) -> str:
        """Output of the command line."""
        return self._own.summary()

    def write(self, folder: Named, *, exr: bool = False) -> list[Path]:
        """Writes the files of `run --out`; returns their paths."""
        return [Path(path) for path in self._own.write(os.fspath(folder), exr)]

    def record(self, path: Named | None = None) -> Recording:
        """The recorded work of the frame, for `replay`; also written into a file if one is named, as by `run --record`."""
        native = self._own.recording()
        if path is not None:
            native.write(os.fspath(path))
        return Recording(native)


class Recording:
    """Recorded work of a frame: its time is computed without drawing again."""

    def __init__(self, recording: Named | _native.Recording) -> None:
        self._own = recording if isinstance(recording, _native.Recording) else _native.Recording.read(os.fspath(recording))

    def set(self, path: str, value: Any) -> Recording:
        """The recording with a changed field of the machine's timing."""
        text = value if isinstance(value, str) else as_json(value, path)
        return Recording(self._own.changed(f"{path}={text}"))

    def replay(self, timing: Timing | None = None, *, answers: bool = False, prices: Named | None = None) -> Replayed:
        """The frame's time; also for every value of the fields of `timing`; with `answers`, also the what-if results."""
        given = self._own.replay(_axes(timing), answers, None if prices is None else os.fspath(prices))
        cycles, timings, would_help = (json.loads(text) for text in given)
        return Replayed(cycles, timings, would_help)


class Replayed:
    """The time of a frame."""

    def __init__(self, cycles: dict[str, Any], timings: dict[str, Any] | None, answers: Any) -> None:
        self.cycles = Node(cycles)
        self.timings = None if timings is None else Node(timings)
        self.answers = None if answers is None else Node({"answers": answers}).answers

    @property
    def units(self) -> pa.Table:
        """One row per unit: its cycles by cause."""
        return table(self.cycles.dict()["units"])


class Story:
    """A pixel trace; printed as text."""

    def __init__(self, text: str, numbers: dict[str, Any]) -> None:
        self.text, self.numbers = text, Node(numbers)

    @property
    def contributions(self) -> pa.Table:
        """One row per contribution, on the machine and in golden."""
        return table(self.numbers.dict()["contributions"])

    def __str__(self) -> str:
        return self.text

    __repr__ = __str__


def _axes(timing: Timing | None) -> list[str]:
    return [f"{path}={','.join(v if isinstance(v, str) else as_json(v, path) for v in values)}" for path, values in (timing or {}).items()]


def run(
    scene: AnyScene = "glass-spheres",
    machine: AnyMachine = None,
    *,
    check: Literal["full", "sampled", "none"] = "full",
    attribute: bool = False,
    answers: bool = False,
    requests: bool = False,
    timing: Timing | None = None,
    prices: Named | None = None,
    progress: Progress | bool = False,
) -> Frame:
    """Draws a scene on a machine and in exact arithmetic, and compares: the command line's `run`.

    machine: the default is the scene's default machine. check: tiles checked in lockstep, "sampled" for one in eight. attribute: report which words
    cause the error (draws 170 frames). answers: report what-if results. requests: keep the requests to memory; `write` then writes them too.
    timing: replay with every value, as {"timing.raster.fifo": [1, 2, 4]}. prices: a file of unit costs.
    """
    native = of_scene(scene), of_machine(machine)
    folder = None if prices is None else os.fspath(prices)
    return Frame(_native.run(*native, check, attribute, answers, requests, _axes(timing), folder, shown(progress)))


class Drawn(Node):
    """All frames of a sequence: the report, as attributes."""

    def __init__(self, fields: dict[str, Any], text: str) -> None:
        super().__init__(fields)
        self.text = text

    @property
    def rows(self) -> pa.Table:
        """One row per frame."""
        return table(self._fields["frames"])

    def summary(self) -> str:
        """Output of the command line."""
        return self.text


def sequence(
    scene: Named,
    machine: AnyMachine = None,
    folder: Named | None = None,
    *,
    size: tuple[int, int] | None = None,
    cameras: Named | None = None,
    exr: bool = False,
    y4m: Named | None = None,
    progress: Progress | bool = False,
) -> Drawn:
    """Draws every frame of a scene that has `cameras` or a `camera_path`: the command line's `run` of a sequence.

    cameras: a file of cameras instead of the scene's. folder: for pictures and the report. y4m: a video of the hardware's pictures.
    """
    paths = [None if path is None else os.fspath(path) for path in (cameras, folder, y4m)]
    report, text = _native.sequence(os.fspath(scene), size, paths[0], of_machine(machine), paths[1], exr, paths[2], shown(progress))
    return Drawn(json.loads(report), text)


def replay(recording: Recording | Named, timing: Timing | None = None, *, answers: bool = False, prices: Named | None = None) -> Replayed:
    """Times a recorded frame again: the command line's `replay`."""
    of = recording if isinstance(recording, Recording) else Recording(recording)
    return of.replay(timing, answers=answers, prices=prices)


def explain(scene: AnyScene, x: int, y: int, machine: AnyMachine = None) -> Story:
    """Pixel trace of the machine and of golden: the command line's `explain`."""
    text, numbers = _native.explain(of_scene(scene), of_machine(machine), x, y)
    return Story(text, json.loads(numbers))


def trace(
    scene: AnyScene,
    folder: Named,
    machine: AnyMachine = None,
    *,
    units: Sequence[str] = (),
    splats: tuple[int, int] | None = None,
    pixels: tuple[int, int, int, int] | None = None,
    sample: int | None = None,
    stimulus: int | None = None,
    waves: tuple[int, int] | None = None,
    seed: int = 0,
) -> str:
    """Writes the transfers between units: the command line's `trace`. Returns its output."""
    native = of_scene(scene), of_machine(machine)
    return _native.trace(*native, os.fspath(folder), list(units), splats, pixels, sample, stimulus, waves, seed)
