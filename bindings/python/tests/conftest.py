"""Fixtures: the command line that the package is compared with."""

import os
import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def splatsim_run(tmp_path):
    """Runs the program of SPLATSIM_PROGRAM in an empty folder and checks its exit status; returns its output, or its error message."""
    program = os.environ.get("SPLATSIM_PROGRAM")
    if program is None:
        pytest.skip("SPLATSIM_PROGRAM names no program to compare with")
    program = Path(program).resolve()

    def run(*arguments, status=0):
        done = subprocess.run([program, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == status, done.stderr
        return done.stdout if status == 0 else done.stderr.strip().removeprefix("splatsim: ")

    return run
