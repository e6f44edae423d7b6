"""Do twins run in cocotb beside the live model?"""

import os
import shutil
from pathlib import Path

import pytest

TRACE = Path(__file__).resolve().parents[3] / "traces/knot"


def test_twins_run_in_cocotb(tmp_path, monkeypatch):
    if "CI" not in os.environ:
        pytest.importorskip("cocotb")
        if shutil.which("vvp") is None:
            pytest.skip("Icarus is needed")
    monkeypatch.syspath_prepend(Path(__file__).parent)
    import twins

    twins.main(TRACE, tmp_path)
