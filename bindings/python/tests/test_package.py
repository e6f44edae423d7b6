"""Features of the package only: arrays of records, tables, threads, Ctrl-C, progress."""

import os
import signal
import threading
import time

import numpy as np
import pyarrow as pa
import pytest

import splatsim

SMALL = splatsim.Scene({"splats": {"builtin": "glass-spheres", "count": 3000}}, size=(48, 32))


def test_a_machine_is_never_changed():
    machine = splatsim.Machine("tiny")
    other = machine.set("gauss.weight", {"format": "U0F9"}).set("fragment.layers", np.int64(3))
    assert machine == splatsim.Machine("tiny") != other
    assert other.words()["gauss.weight"] == "U0F9" and other.dict()["fragment"]["layers"] == 3
    assert splatsim.Machine(other.dict()) == other
    assert splatsim.Machine({"base": "tiny", "fragment": {"layers": 3}}).dict()["fragment"]["layers"] == 3


def test_arrays_of_records_are_records():
    unit = splatsim.Unit("gauss", "reference", SMALL)
    records = [unit.random() for _ in range(500)]
    answers = unit.map(**{name: [record[name] for record in records] for name in unit.fields()})
    one_by_one = [unit.step(record) for record in records]
    assert answers.counts.tolist() == [len(given) for given in one_by_one]
    assert {name: column.tolist() for name, column in answers.items()} == {
        name: [record[name] for given in one_by_one for record in given] for name in unit.fields("out")
    }
    curve = unit.map(radial=np.arange(0, 2**20, 2**14), amplitude=max(record["amplitude"] for record in records))
    assert len(curve["weight"]) == 64 and np.all(np.diff(curve["weight"]) <= 0) and curve["weight"][0] > curve["weight"][-1]


@pytest.mark.parametrize(
    "fields, message",
    [
        ({"radial": [0, -1], "amplitude": [1, 1]}, "gauss.in: record 1: field radial: -1, and 0 to"),
        ({"radial": [0.5], "amplitude": [1]}, "radial is of float64"),
        ({"radial": [2**63], "amplitude": [1]}, "radial is 9223372036854775808"),
        ({"radial": [2**70], "amplitude": [1]}, "radial is of object"),
        ({"radial": [1]}, "gauss.in: amplitude: a record has radial, amplitude"),
    ],
)
def test_invalid_arrays_of_records_are_refused(fields, message):
    with pytest.raises(splatsim.SplatsimError, match=message):
        splatsim.Unit("gauss", "reference", SMALL).map(**fields)


@pytest.mark.parametrize(
    "splats, message",
    [
        ({"position": np.zeros((2, 2))}, "splats.position has the shape"),
        ({"position": np.zeros((2, 3)), "radius": np.ones(3)}, "splats.radius has the shape"),
        ({"position": np.full((2, 3), np.nan)}, r"splats\[0\].position must be"),
        ({"position": np.zeros((2, 3)), "normal": np.full((2, 3), np.inf)}, r"splats\[0\].normal must be"),
        ({"position": np.zeros((2, 3)), "radius": np.array([1.0, -1.0])}, r"splats\[1\].radius must be"),
        ({"position": np.zeros((2, 3)), "rgb": np.full((2, 3), 1.5)}, r"splats\[0\].rgb must be"),
        ({"position": np.zeros((2, 3)), "opacity": np.array([1.0, np.nan])}, r"splats\[1\].opacity must be"),
        ({"position": np.zeros((2, 3)), "material": np.array([0, 7])}, r"splats\[1\] uses material 7"),
        ({"position": np.zeros((2, 3)), "material": np.array([0, -1])}, "splats.material must be whole numbers"),
        ({"position": np.zeros((2, 3)), "colour": np.zeros((2, 3))}, "splats.colour: no such array"),
        ({"position": np.zeros((2, 3), complex)}, "splats.position is of complex128"),
        ({"position": np.zeros((0, 3))}, "holds no splats"),
    ],
)
def test_invalid_arrays_of_splats_are_refused(splats, message):
    with pytest.raises(splatsim.InputError, match=message):
        splatsim.Scene({"splats": splats})


def test_a_value_that_is_not_json_is_refused():
    with pytest.raises(splatsim.InputError, match="a set is not JSON"):
        splatsim.Machine({"base": {1, 2}})
    with pytest.raises(splatsim.InputError, match="Out of range float"):
        splatsim.Scene({"splats": [{"position": [0, 0, float("nan")]}]})


def test_tables_are_arrow():
    frame = splatsim.run(SMALL, "tiny")
    assert isinstance(frame.signals, pa.Table) and hasattr(frame.signals, "__arrow_c_stream__")
    assert frame.signals.num_rows == len(frame.report.signals) > 10
    assert frame.cycles.column("name").to_pylist() == [unit.name for unit in frame.report.cycles.units]
    with pytest.raises(AttributeError, match="the report has no psnr here; it has"):
        frame.report.accuracy.psnr


def test_the_interpreter_goes_on_while_a_scene_is_drawn():
    beats, is_over = [], threading.Event()

    def beat():
        while not is_over.wait(0.01):
            beats.append(time.monotonic())

    thread = threading.Thread(target=beat)
    thread.start()
    splatsim.run(splatsim.Scene("glass-spheres", size=(128, 96)))
    is_over.set()
    thread.join()
    assert len(beats) >= 5 and max(np.diff(beats)) < 1


def test_control_c_stops_within_a_second(tmp_path):
    plan = {"scenes": ["glass-spheres"], "size": [128, 96], "axes": [{"field": "gauss.weight", "add_frac_bits": list(range(-12, 3))}]}
    folder = tmp_path / "sweep"
    sent = []
    # A shell that runs this in the background may ignore the signal.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt():
        while not list(folder.glob("points*.jsonl")):
            time.sleep(0.01)
        time.sleep(0.2)
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        splatsim.sweep(plan, folder)
    assert time.monotonic() - sent[0] < 1
    thread.join()
    # The unfinished row is not written, and no other row is drawn in the background.
    time.sleep(1)
    [journal] = folder.glob("points*.jsonl")
    rows = journal.read_text().count("\n") - 1
    time.sleep(1)
    assert journal.read_text().count("\n") - 1 == rows < 15


def test_a_callback_that_raises_stops_the_job(tmp_path):
    def fail(done, total, message):
        raise RuntimeError("enough")

    plan = {"scenes": ["glass-spheres"], "size": [64, 48], "axes": [{"field": "gauss.weight", "add_frac_bits": list(range(-12, 3))}]}
    with pytest.raises(RuntimeError, match="enough"):
        splatsim.sweep(plan, tmp_path / "sweep", progress=fail)


def test_threads_draw_in_parallel():
    expected = splatsim.run(SMALL, "tiny").fixed
    found = []
    threads = [threading.Thread(target=lambda: found.append(splatsim.run(SMALL, "tiny").fixed)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and all(np.array_equal(picture, expected) for picture in found)


def test_another_seed_is_another_search():
    scene = splatsim.Scene({"splats": {"builtin": "glass-spheres", "count": 300}}, size=(24, 16))

    def rows(seed):
        found = splatsim.search(scene, "reference", target_psnr=40, only=["gauss", "splat.rgb"], views=0, tries=20, seed=seed)
        return found.table.drop_columns(["host_seconds"])

    first = rows(0)
    assert rows(0).equals(first) and not all(rows(seed).equals(first) for seed in (1, 2, 3))
