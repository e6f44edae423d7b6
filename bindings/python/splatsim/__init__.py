"""splatsim for Python: machines, scenes, pictures, reports, sweeps, and units record by record.

It runs the Rust code of the command line and gives the same bits. An error is an exception with the command line's sentence.

    >>> import splatsim
    >>> machine = splatsim.Machine("tiny").set("gauss.weight", "U0F10")
    >>> scene = splatsim.Scene({"splats": {"builtin": "glass-spheres", "count": 5000}}, size=(64, 48))
    >>> frame = splatsim.run(scene, machine)
    >>> frame.fixed.shape
    (48, 64, 4)
    >>> frame.report.scene.splats
    5000
"""

from splatsim._explore import Found, Rows, draw, search, sweep
from splatsim._frame import Drawn, Frame, Recording, Replayed, Story, explain, replay, run, sequence, trace
from splatsim._models import Machine, Scene
from splatsim._native import VERSION as __version__
from splatsim._native import InputError, JobError, SplatsimError
from splatsim._report import Node
from splatsim._unit import Answers, Unit

__all__ = [
    "Answers",
    "Drawn",
    "Found",
    "Frame",
    "InputError",
    "JobError",
    "Machine",
    "Node",
    "Recording",
    "Replayed",
    "Rows",
    "Scene",
    "SplatsimError",
    "Story",
    "Unit",
    "__version__",
    "draw",
    "explain",
    "replay",
    "run",
    "search",
    "sequence",
    "sweep",
    "trace",
]
