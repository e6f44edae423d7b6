"""Do RTL implementations agree with the live model in cocotb?"""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

TRACE = Path(__file__).resolve().parents[3] / "traces/knot"


def test_rtl_units_agree_in_cocotb(tmp_path, monkeypatch):
    if "CI" not in os.environ:
        pytest.importorskip("cocotb")
        if shutil.which("vvp") is None:
            pytest.skip("Icarus is needed")
    monkeypatch.syspath_prepend(Path(__file__).parent)
    import twins

    twins.main(TRACE, tmp_path)


def test_the_page_of_ten_minutes_runs_in_cocotb(tmp_path):
    if "CI" not in os.environ:
        pytest.importorskip("cocotb")
        if shutil.which("vvp") is None:
            pytest.skip("Icarus is needed")
    root = TRACE.parents[1]
    page = (root / "docs/book/check-rtl.md").read_text()
    block = page.split("```bash\n# cocotb\n")[1].split("\n```")[0]
    (tmp_path / "rtl_model").symlink_to(root / "rtl_model")
    (tmp_path / "raster-trace").symlink_to(TRACE)
    python = f"python3() {{ {shlex.quote(sys.executable)} \"$@\"; }}\n"
    subprocess.run(["bash", "-euo", "pipefail", "-c", python + block], cwd=tmp_path, check=True)
    assert (tmp_path / "device.hex").read_text() == (TRACE / "raster.out.hex").read_text()
