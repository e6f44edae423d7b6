"""Do the notebooks and the examples of the docstrings run?"""

import doctest
import os
import shutil
from pathlib import Path

import pytest

import splatsim

NOTEBOOKS = sorted((Path(__file__).resolve().parents[1] / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    if "CI" not in os.environ:
        pytest.importorskip("nbclient")
        if "rtl" in path.stem and (shutil.which("vvp") is None or not pytest.importorskip("cocotb")):
            pytest.skip("Icarus is needed")
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "no outputs are kept"
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": path.parent}}).execute()


def test_all_three_are_there():
    assert len(NOTEBOOKS) == 3


def test_examples_of_docstrings_give_their_results():
    failed, tried = doctest.testmod(splatsim)
    assert tried >= 6 and failed == 0
