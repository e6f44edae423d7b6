"""Sweeps and searches."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from splatsim import _native
from splatsim._frame import AnyMachine, AnyScene
from splatsim._models import Machine, Named, as_json, of_machine, of_scene
from splatsim._report import Node, Progress, shown


class Rows:
    """Rows of a sweep: one per machine and scene."""

    def __init__(self, table: pa.Table, text: str, files: list[Path]) -> None:
        self.table, self.text, self.files = table, text, files

    def summary(self) -> str:
        """Output of the command line."""
        return self.text


class Found(Node):
    """Result of a search: `machine`, and the report as attributes."""

    def __init__(self, fields: dict[str, Any], table: pa.Table, text: str) -> None:
        super().__init__(fields)
        self.table, self.text = table, text

    @property
    def found(self) -> Machine:
        """The machine, with its search record."""
        return Machine({**self._fields["machine"], "searched": self._fields["searched"]})

    def summary(self) -> str:
        """Output of the command line."""
        return self.text


def _folder(folder: Named | None, stack: ExitStack) -> str:
    return os.fspath(folder) if folder is not None else stack.enter_context(tempfile.TemporaryDirectory(prefix="splatsim-"))


def _optional(path: Named | None) -> str | None:
    return None if path is None else os.fspath(path)


def _plan(plan: Named | Mapping[str, Any]) -> tuple[str, str | None]:
    return ("plan", as_json(plan, "plan")) if isinstance(plan, Mapping) else (os.fspath(plan), None)


def draw(plan: Named | Mapping[str, Any], points: Iterable[int], *, prices: Named | None = None) -> pa.Table:
    """Draws these points of a plan, numbered as in a sweep's column `point`; returns their rows, without a folder."""
    batches = _native.draw(*_plan(plan), sorted(set(points)), _optional(prices))
    return pa.concat_tables([pyarrow.parquet.read_table(pa.BufferReader(batch)) for batch in batches])


def sweep(
    plan: Named | Mapping[str, Any],
    folder: Named | None = None,
    *,
    client: Any = None,
    shard: str | None = None,
    most: int = 100_000,
    prices: Named | None = None,
    progress: Progress | bool = False,
) -> Rows:
    """Draws every machine of a plan, one row each: the command line's `sweep`.

    plan: the name of a built-in one, a file, or a dict as in a file. folder: its rows are not drawn again; without a folder, no file is kept.
    client: a `distributed.Client` whose workers draw, a scheduler's address, or True for workers on this computer. shard: "2/5" draws only
    part 2 of 5.
    """
    if client is not None and shard is not None:
        raise _native.InputError("shard: with a client its workers share the whole plan")
    with ExitStack() as stack:
        into = _folder(folder, stack)
        if client is None:
            job = _native.sweep(*_plan(plan), into, shard, most, _optional(prices), shown(progress))
        else:
            from splatsim import _cluster

            workers = stack.enter_context(_cluster.client_of(client))
            own = _native.Sweep.open(*_plan(plan), into, most, _optional(prices))
            stack.callback(own.close)
            _cluster.carry_out(own, workers, shown(progress))
            job = own.finish()
        table = pyarrow.parquet.read_table(Path(into) / "sweep.parquet")
        return Rows(table, job.summary, [Path(file) for file in job.files] if folder is not None else [])


def search(
    scenes: AnyScene | Sequence[AnyScene],
    machine: AnyMachine = None,
    folder: Named | None = None,
    *,
    client: Any = None,
    target_psnr: float | None = None,
    max_error: float | None = None,
    against_ideal: bool = False,
    no_saturation: bool = False,
    views: int = 8,
    seed: int = 0,
    tries: int = 300,
    only: Sequence[str] = (),
    prices: Named | None = None,
    progress: Progress | bool = False,
) -> Found:
    """Finds the narrowest machine that meets a target on all scenes, and on unseen cameras: the command line's `search`.

    client: as in `sweep`; its workers measure machines. The result is the same as of one process.
    """
    if target_psnr is None and max_error is None:
        raise _native.InputError("a search needs target_psnr or max_error")
    several = list(scenes) if isinstance(scenes, Sequence) and not isinstance(scenes, str) else [scenes]
    with ExitStack() as stack:
        into = _folder(folder, stack)
        crew = None
        if client is not None:
            from splatsim import _cluster

            crew = stack.enter_context(_cluster.measuring(client))
        job = _native.search(
            [of_scene(scene) for scene in several],
            of_machine(machine),
            into,
            target_psnr,
            max_error,
            against_ideal,
            no_saturation,
            views,
            seed,
            tries,
            list(only),
            _optional(prices),
            crew,
            shown(progress),
        )
        table = pyarrow.parquet.read_table(Path(into) / "search.parquet")
        return Found(json.loads(job.json), table, job.summary)
