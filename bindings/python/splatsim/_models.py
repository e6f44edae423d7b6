"""Machines and scenes."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from splatsim import _native
from splatsim._native import InputError

Named = str | os.PathLike[str]
#: JSON objects.
Fields = dict[str, Any]
Formats = dict[str, str]
Numbers = NDArray[Any]
#: Position, normal, radius, colour, opacity, material.
Columns = tuple[Numbers, Numbers, Numbers, Numbers, Numbers, Numbers]


class Machine:
    """A machine: a name, a file, or a dict as in a machine file. It is immutable; `set` returns another one."""

    _own: _native.Machine

    def __init__(self, machine: Named | Mapping[str, Any] | Machine = "reference") -> None:
        if isinstance(machine, Machine):
            self._own = machine._own
        elif isinstance(machine, Mapping):
            self._own = _native.Machine.parse(as_json(machine, "the machine"), "the machine")
        else:
            self._own = _native.Machine.open(os.fspath(machine))

    @classmethod
    def _of(cls, native: _native.Machine) -> Machine:
        made = cls.__new__(cls)
        made._own = native
        return made

    def set(self, path: str, value: Any) -> Machine:
        """The machine with a changed field: `set("gauss.weight", "U-2F12")` is the command line's `--set gauss.weight=U-2F12`."""
        text = value if isinstance(value, str) else as_json(value, path)
        return Machine._of(self._own.changed(f"{path}={text}"))

    def with_settings(self, *settings: str) -> Machine:
        """The machine with changes such as "gauss.weight=U-2F12"."""
        native = self._own
        for setting in settings:
            native = native.changed(setting)
        return Machine._of(native)

    @property
    def name(self) -> str:
        """Its name."""
        return str(self.dict()["name"])

    def dict(self) -> Fields:
        """The fields of its machine file."""
        fields: Fields = json.loads(self._own.json())
        return fields

    def words(self) -> Formats:
        """Every word that can be set, and its format."""
        return Formats(self._own.words())

    def save(self, path: Named) -> None:
        """Writes a machine file."""
        Path(path).write_text(json.dumps(self.dict(), indent=2, ensure_ascii=False) + "\n")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Machine) and self.dict() == other.dict()

    def __reduce__(self) -> tuple[Any, ...]:
        return (Machine, (self.dict(),))

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<splatsim.Machine {self.name}>"


class Scene:
    """A scene: a file, a built-in name, or a dict as in a scene file.

    size: columns and rows instead of the scene's own. frame: number in a sequence. folder: folder of the files that a dict names. In a dict, `splats`
    may be a dict of arrays: position (n, 3), and optionally normal (n, 3), radius (n), rgb (n, 3, linear light), opacity (n), material (n). A normal
    or a radius of 0 is estimated from neighbours.
    """

    def __init__(
        self,
        scene: Named | Mapping[str, Any] = "glass-spheres",
        *,
        size: tuple[int, int] | None = None,
        frame: int | None = None,
        folder: Named = "",
        name: str = "scene",
    ) -> None:
        if not isinstance(scene, Mapping):
            self._own = _native.Scene.open(os.fspath(scene), size, frame)
            return
        place = os.fspath(folder)
        splats = scene.get("splats")
        if isinstance(splats, Mapping) and "position" in splats and np.ndim(splats["position"]) == 2:
            text = as_json({**scene, "splats": []}, name)
            self._own = _native.Scene.of_splats(_columns(splats, name), text, name, place, size, frame)
        else:
            self._own = _native.Scene.parse(as_json(scene, name), name, place, size, frame)

    @property
    def name(self) -> str:
        """Its name."""
        return self._own.name

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of its picture."""
        return self._own.size

    @property
    def notes(self) -> list[str]:
        """Sentences about omitted or unusual data."""
        return self._own.notes

    @property
    def usual_machine(self) -> str:
        """Name of the default machine for the scene."""
        return self._own.usual_machine

    def __len__(self) -> int:
        return self._own.splats

    def __repr__(self) -> str:
        columns, rows = self.size
        return f"<splatsim.Scene {self.name}, {len(self)} splats, {columns}×{rows}>"


def of_scene(scene: Scene | Named | Mapping[str, Any]) -> _native.Scene:
    """The native scene."""
    return (scene if isinstance(scene, Scene) else Scene(scene))._own


def of_machine(machine: Machine | Named | Mapping[str, Any] | None) -> _native.Machine | None:
    """The native machine; None for the scene's default machine."""
    return None if machine is None else Machine(machine)._own


def as_json(value: Any, whose: str) -> str:
    """JSON, also for NumPy's numbers and arrays."""

    def plain(odd: Any) -> Any:
        if isinstance(odd, np.ndarray | np.generic):
            return odd.tolist()
        if isinstance(odd, Mapping):
            return dict(odd)
        if isinstance(odd, os.PathLike):
            return os.fspath(odd)
        raise TypeError(f"a {type(odd).__name__} is not JSON")

    try:
        return json.dumps(value, default=plain, allow_nan=False)
    except (TypeError, ValueError) as fault:
        raise InputError(f"{whose}: {fault}") from None


#: Numbers per splat, and the default.
_COLUMNS: dict[str, tuple[int, float]] = {
    "position": (3, 0.0),
    "normal": (3, 0.0),
    "radius": (1, 0.0),
    "rgb": (3, 0.5),
    "opacity": (1, 1.0),
    "material": (1, 0.0),
}


def _columns(splats: Mapping[str, ArrayLike], name: str) -> Columns:
    if odd := [field for field in splats if field not in _COLUMNS]:
        raise InputError(f"{name}: splats.{odd[0]}: no such array; there are {', '.join(_COLUMNS)}")
    count = len(np.asarray(splats["position"]))

    def column(field: str) -> NDArray[Any]:
        each, usual = _COLUMNS[field]
        shape = (count, each) if each > 1 else (count,)
        kind = np.uint32 if field == "material" else np.float64
        if field not in splats:
            return np.full(shape, usual, kind)
        given = np.asarray(splats[field])
        if given.shape != shape:
            raise InputError(f"{name}: splats.{field} has the shape {given.shape} instead of {shape}")
        is_whole = np.issubdtype(given.dtype, np.integer)
        if field == "material" and (not is_whole or (count and not 0 <= given.min() <= given.max() < 2**32)):
            raise InputError(f"{name}: splats.material must be whole numbers from 0 to {2**32 - 1}")
        if not (is_whole or np.issubdtype(given.dtype, np.floating)):
            raise InputError(f"{name}: splats.{field} is of {given.dtype}: it must be numbers")
        return np.ascontiguousarray(given, kind)

    return (column("position"), column("normal"), column("radius"), column("rgb"), column("opacity"), column("material"))
