"""Types of the native library; for the modules of this package only."""

from collections.abc import Callable
from typing import Any, TypeAlias, final

from numpy.typing import NDArray

__all__ = [
    "VERSION",
    "InputError",
    "Job",
    "JobError",
    "Machine",
    "Outcome",
    "Recording",
    "Scene",
    "SplatsimError",
    "Stage",
    "Sweep",
    "Unit",
    "View",
    "draw",
    "explain",
    "measure",
    "run",
    "search",
    "sequence",
    "sweep",
    "trace",
]

VERSION: str

_Columns: TypeAlias = tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]
_Progress: TypeAlias = Callable[[float, float | None, str], object] | None

class SplatsimError(ValueError):
    """An error, in a sentence."""

class InputError(SplatsimError):
    """An argument or a file is wrong: the command line's exit status 2."""

class JobError(SplatsimError):
    """The work failed, for example on a full disk: the command line's exit status 1."""

@final
class Machine:
    @staticmethod
    def open(name_or_path: str) -> Machine: ...
    @staticmethod
    def parse(text: str, whose: str) -> Machine: ...
    def changed(self, setting: str) -> Machine: ...
    def json(self) -> str: ...
    def words(self) -> list[tuple[str, str]]: ...

@final
class Scene:
    @staticmethod
    def open(name_or_path: str, size: tuple[int, int] | None, frame: int | None) -> Scene: ...
    @staticmethod
    def parse(text: str, name: str, folder: str, size: tuple[int, int] | None, frame: int | None) -> Scene: ...
    @staticmethod
    def of_splats(columns: _Columns, text: str, name: str, folder: str, size: tuple[int, int] | None, frame: int | None) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def splats(self) -> int: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def usual_machine(self) -> str: ...

@final
class Outcome:
    def report(self) -> str: ...
    def summary(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]: ...
    def picture(self, which: str) -> bytes: ...
    def write(self, folder: str, exr: bool) -> list[str]: ...
    def recording(self) -> Recording: ...

@final
class Recording:
    @staticmethod
    def read(path: str) -> Recording: ...
    def write(self, path: str) -> None: ...
    def changed(self, setting: str) -> Recording: ...
    def replay(self, timing: list[str], answers: bool, prices: str | None) -> tuple[str, str, str]: ...

@final
class Unit:
    def __new__(cls, name: str, machine: Machine | None, scene: Scene, seed: int) -> Unit: ...
    def fields(self, port: str) -> list[str]: ...
    def registers(self, name: str) -> tuple[list[str], list[list[int]]]: ...
    def give(self, words: list[int]) -> None: ...
    def end(self) -> None: ...
    def waiting(self, port: str) -> int: ...
    def take(self, port: str) -> list[list[int]]: ...
    def compare(self, port: str, words: list[int]) -> str | None: ...
    def random(self) -> list[int]: ...
    def map(self, words: NDArray[Any], fields: int) -> tuple[bytes, bytes]: ...

@final
class Job:
    @property
    def files(self) -> list[str]: ...
    @property
    def summary(self) -> str: ...
    @property
    def json(self) -> str: ...

@final
class Sweep:
    @staticmethod
    def open(name: str, text: str | None, folder: str, most: int, prices: str | None) -> Sweep: ...
    def counts(self) -> tuple[int, int]: ...
    def missing(self, scene: int) -> list[list[int]]: ...
    def plan(self) -> str: ...
    def scene(self, scene: int) -> bytes: ...
    def keep(self, numbers: list[int], batch: bytes) -> None: ...
    def finish(self) -> Job: ...
    def close(self) -> None: ...

@final
class Stage:
    def __new__(cls, plan: str, number: int, scene: bytes, threads: int) -> Stage: ...
    def draw(self, numbers: list[int], threads: int) -> bytes: ...

@final
class View:
    def __new__(cls, view: bytes) -> View: ...

def measure(views: list[View], machine: str, target: str, threads: int) -> str: ...
def draw(name: str, text: str | None, numbers: list[int], prices: str | None) -> list[bytes]: ...
def run(
    scene: Scene,
    machine: Machine | None,
    check: str,
    attribute: bool,
    answers: bool,
    requests: bool,
    timing: list[str],
    prices: str | None,
    progress: _Progress,
) -> Outcome: ...
def sequence(
    name: str,
    size: tuple[int, int] | None,
    cameras: str | None,
    machine: Machine | None,
    folder: str | None,
    exr: bool,
    video: str | None,
    progress: _Progress,
) -> tuple[str, str]: ...
def explain(scene: Scene, machine: Machine | None, x: int, y: int) -> tuple[str, str]: ...
def trace(
    scene: Scene,
    machine: Machine | None,
    folder: str,
    units: list[str],
    splats: tuple[int, int] | None,
    pixels: tuple[int, int, int, int] | None,
    sample: int | None,
    stimulus: int | None,
    waves: tuple[int, int] | None,
    seed: int,
) -> str: ...
def sweep(
    name: str,
    text: str | None,
    folder: str,
    shard: str | None,
    most: int,
    prices: str | None,
    progress: _Progress,
) -> Job: ...
def search(
    scenes: list[Scene],
    machine: Machine | None,
    folder: str,
    target_psnr: float | None,
    max_error: float | None,
    against_ideal: bool,
    no_saturation: bool,
    views: int,
    seed: int,
    tries: int,
    only: list[str],
    prices: str | None,
    crew: Any,
    progress: _Progress,
) -> Job: ...
