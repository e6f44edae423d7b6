"""What tests share: the command line that the package is held against."""

import os
import subprocess
from pathlib import Path

import pytest


#: What takes long: of these a run has a tenth, as SPLATSIM_SHARE says (tests/share/mod.rs), or none.
IN_TURN = ("test_cluster.py", "test_cocotb.py", "test_notebooks.py")


def pytest_collection_modifyitems(config, items):
    share = os.environ.get("SPLATSIM_SHARE", "0")
    turn = None if share == "all" else int(share) % 12
    turns = [turn for turn in range(12) if turn % 6]
    long = [item for item in items if item.path.name in IN_TURN]
    left_out = [item for number, item in enumerate(long) if turn not in (None, turns[number % 10])]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


@pytest.fixture
def splatsim_run(tmp_path):
    """Runs the program of SPLATSIM_PROGRAM in an empty folder: exit status, what it prints, what it complains."""
    program = os.environ.get("SPLATSIM_PROGRAM")
    if program is None:
        pytest.skip("SPLATSIM_PROGRAM names no program to compare with")
    program = Path(program).resolve()

    def run(*arguments, status=0):
        done = subprocess.run([program, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        return done.stdout if status == 0 else done.stderr.strip().removeprefix("splatsim: ")

    return run
