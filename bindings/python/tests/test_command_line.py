"""Are all results those of the command line, bit for bit?"""

import json

import numpy as np
import pyarrow.parquet as parquet
import pytest

import splatsim

SIZE = ["--size", "48x32"]
SCENE = {
    "splats": [
        {"position": [0.1 * x, 0.1 * y, 0.05 * x * y], "normal": [0.2, 0.1, 1], "radius": 0.08, "rgb": [0.1 * x, 0.2, 0.1 * y], "opacity": 0.7}
        for x in range(8)
        for y in range(8)
    ],
    "image": {"width": 40, "height": 30, "background": [0.1, 0.2, 0.3, 1]},
}


def few(folder, scene="glass-spheres", count=3000):
    """A scene with this many splats: loading the default number would dominate a small run."""
    path = folder / f"{scene}.json"
    path.write_text(json.dumps({"splats": {"builtin": scene, "count": count}}))
    return str(path)


def without_host(report):
    return {name: value for name, value in report.items() if name != "host"}


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != "report.json"}


@pytest.mark.parametrize(
    "scene, settings",
    [
        ("glass-spheres", []),
        ("torus-knot", ["gauss.weight=U-2F12", "timing.raster.lanes=[2, 2]"]),
        ("nested-shells", ["splat.rgb=U1F1"]),
        ("bouquet", []),
    ],
)
def test_a_run_is_the_command_line_s(splatsim_run, tmp_path, scene, settings):
    if scene in ("glass-spheres", "torus-knot"):
        scene = few(tmp_path, scene)
    seen = splatsim.Scene(scene, size=(48, 32))
    machine = splatsim.Machine(seen.usual_machine).with_settings(*settings)
    frame = splatsim.run(seen, machine, requests=True)
    options = [word for setting in settings for word in ("--set", setting)]
    printed = splatsim_run("run", scene, *SIZE, *options, "--requests", "--out", "theirs", "--record", "theirs.work")
    frame.write(tmp_path / "ours", exr=False)
    assert files(tmp_path / "ours") == files(tmp_path / "theirs") and list(tmp_path.glob("ours/requests.*"))
    theirs = json.loads((tmp_path / "theirs/report.json").read_text())
    assert without_host(frame.report.dict()) == without_host(theirs)
    assert frame.summary().splitlines()[:3] == printed.splitlines()[:3]
    frame.record(tmp_path / "ours.work")
    assert (tmp_path / "ours.work").read_bytes() == (tmp_path / "theirs.work").read_bytes()


@pytest.mark.parametrize("check", ["sampled", "none"])
def test_the_lockstep_check_covers_what_the_command_line_s_does(splatsim_run, tmp_path, check):
    scene = few(tmp_path)
    frame = splatsim.run(splatsim.Scene(scene, size=(48, 32)), check=check)
    splatsim_run("run", scene, *SIZE, "--check", check, "--out", "theirs")
    frame.write(tmp_path / "ours", exr=False)
    assert files(tmp_path / "ours") == files(tmp_path / "theirs")
    accuracy = json.loads((tmp_path / "theirs/report.json").read_text())["accuracy"]
    assert frame.report.accuracy.dict() == accuracy and ("lockstep" in accuracy) == (check == "sampled")
    with pytest.raises(splatsim.InputError, match="full, sampled or none"):
        splatsim.run(scene, check="some")


def test_pictures_are_those_of_the_files(tmp_path, splatsim_run):
    frame = splatsim.run(splatsim.Scene(few(tmp_path), size=(48, 32)))
    assert frame.fixed.shape == frame.golden.shape == frame.ideal.shape == frame.error.shape == (32, 48, 4)
    difference = np.abs(frame.fixed - frame.golden)
    assert np.array_equal(frame.error[..., :3], np.clip(difference[..., :3] * frame.report.error_scale, 0, 1))
    squares = np.mean(difference[..., :3] ** 2)
    assert frame.report.accuracy.fixed_vs_golden.psnr_db == pytest.approx(-10 * np.log10(squares), abs=1e-9)
    assert not np.array_equal(frame.golden, frame.ideal)


def test_dicts_arrays_and_files_are_the_same_scene(tmp_path, splatsim_run):
    (tmp_path / "scene.json").write_text(json.dumps(SCENE))
    arrays = {name: np.array([splat[name] for splat in SCENE["splats"]]) for name in SCENE["splats"][0]}
    from_file, from_dict = splatsim.Scene(tmp_path / "scene.json"), splatsim.Scene(SCENE)
    from_arrays = splatsim.Scene({**SCENE, "splats": arrays})
    pictures = [splatsim.run(scene, "tiny").fixed for scene in (from_file, from_dict, from_arrays)]
    assert np.array_equal(pictures[0], pictures[1]) and np.array_equal(pictures[0], pictures[2])
    assert pictures[0].std() > 0.01
    # Missing arrays are estimated; numbers of other types and transposed arrays are accepted.
    fitted = {"position": np.asfortranarray(arrays["position"]), "rgb": np.full((64, 3), 0.5, np.float32)}
    left_out = [{"position": splat["position"]} for splat in SCENE["splats"]]
    ours, theirs = (splatsim.run(splatsim.Scene({**SCENE, "splats": splats}), "tiny").fixed for splats in (fitted, left_out))
    assert np.array_equal(ours, theirs)


@pytest.mark.parametrize(
    "call, arguments",
    [
        (lambda: splatsim.Machine("reverence"), ["--machine", "reverence"]),
        (lambda: splatsim.Machine().set("gauss.wait", "U1F1"), ["--set", "gauss.wait=U1F1"]),
        (lambda: splatsim.Machine().set("gauss.weight", "U1Q1"), ["--set", "gauss.weight=U1Q1"]),
        (lambda: splatsim.Machine().set("gauss.table.interpolation", "cubic"), ["--set", "gauss.table.interpolation=cubic"]),
        (lambda: splatsim.run(machine=splatsim.Machine().set("fragment.layers", 9000)), ["--set", "fragment.layers=9000"]),
        (lambda: splatsim.run(machine=splatsim.Machine().set("splat.rgb", "U40F40")), ["--set", "splat.rgb=U40F40"]),
        (lambda: splatsim.run(timing={"timing.raster.fifo": [0]}), ["--timing", "timing.raster.fifo=0"]),
        (lambda: splatsim.Scene("terrine"), ["terrine"]),
        (lambda: splatsim.Scene(size=(0, 9)), ["--size", "0x9"]),
        (lambda: splatsim.Scene("glass-spheres", frame=3), ["--frame", "3"]),
    ],
)
def test_faults_have_the_command_line_s_sentences(splatsim_run, call, arguments):
    with pytest.raises(splatsim.InputError) as fault:
        call()
    assert str(fault.value) == splatsim_run("run", *arguments, status=2)


def test_a_file_s_faults_are_a_dict_s(splatsim_run, tmp_path):
    for kind, given, made in [
        ("machine", {"base": "tiny", "gauss": {"wait": 1}}, splatsim.Machine),
        ("machine", {"base": "mini"}, splatsim.Machine),
        ("scene", {"splats": {"builtin": "tea-pot"}}, splatsim.Scene),
        ("scene", {**SCENE, "image": {"width": -1}}, splatsim.Scene),
    ]:
        path = tmp_path / "given.json"
        path.write_text(json.dumps(given))
        with pytest.raises(splatsim.InputError) as fault:
            made(given)
        complaint = splatsim_run("run", *([path] if kind == "scene" else ["--machine", path]), status=2)
        assert str(fault.value).split(": ", 1)[1] == complaint.split(": ", 1)[1]


def test_a_replay_is_the_command_line_s(splatsim_run, tmp_path):
    frame = splatsim.run(SCENE)
    recording = frame.record(tmp_path / "frame.work")
    splatsim_run("replay", "frame.work", "--set", "timing.raster.fifo=1", "--out", "theirs")
    replayed = splatsim.Recording(tmp_path / "frame.work").set("timing.raster.fifo", 1).replay()
    assert replayed.cycles.dict() == json.loads((tmp_path / "theirs/cycles.json").read_text())
    assert recording.replay().cycles.dict() == frame.report.cycles.dict()
    rows = splatsim.replay(recording, {"timing.raster.fifo": [1, 4]}).timings.rows
    assert len(rows) == 2 and rows[0].cycles.total >= rows[1].cycles.total > 0


def test_a_pixel_trace_is_the_command_line_s(splatsim_run, tmp_path):
    scene = few(tmp_path)
    story = splatsim.explain(splatsim.Scene(scene, size=(48, 32)), 24, 16, "reference")
    assert str(story).strip() == splatsim_run("explain", scene, *SIZE, "--pixel", "24,16").strip()
    theirs = splatsim_run("explain", scene, *SIZE, "--pixel", "24,16", "--json")
    assert story.numbers.dict() == json.loads(theirs)
    assert story.contributions.num_rows == len(story.numbers.contributions) > 0


def test_a_sequence_is_the_command_line_s(splatsim_run, tmp_path):
    camera = {"target": [0.4, 0.4, 0], "up": [0, 1, 0], "fov_y_degrees": 45, "near": 0.05}
    moving = {**SCENE, "cameras": [{**camera, "eye": [0, 0, distance]} for distance in (2, 2.5, 3)]}
    (tmp_path / "moving.json").write_text(json.dumps(moving))
    drawn = splatsim.sequence(tmp_path / "moving.json", "tiny", tmp_path / "ours", y4m=tmp_path / "ours.y4m")
    splatsim_run("run", "moving.json", "--machine", "tiny", "--out", "theirs", "--y4m", "theirs.y4m")
    assert files(tmp_path / "ours") == files(tmp_path / "theirs")
    assert (tmp_path / "ours.y4m").read_bytes() == (tmp_path / "theirs.y4m").read_bytes()
    theirs = json.loads((tmp_path / "theirs/report.json").read_text())
    # The scene has the name of the given path.
    theirs["scene"]["name"] = drawn.scene.name
    assert without_host(drawn.dict()) == without_host(theirs) and drawn.rows.num_rows == 3
    with pytest.raises(splatsim.InputError, match="has one camera"):
        splatsim.sequence("glass-spheres")


def test_a_trace_is_the_command_line_s(splatsim_run, tmp_path):
    scene = few(tmp_path)
    table = splatsim.trace(scene, tmp_path / "ours", "tiny", units=["gauss"], stimulus=20, seed=7)
    printed = splatsim_run("trace", scene, "--machine", "tiny", "--units", "gauss", "--stimulus", 20, "--seed", 7, "--out", "theirs")
    assert printed.startswith(table.strip())
    assert files(tmp_path / "ours") == files(tmp_path / "theirs")


PLAN = {
        "size": [32, 24],
    "machine": "tiny",
    "lockstep": False,
    "axes": [{"field": "gauss.weight", "add_frac_bits": [-2, 0]}, {"field": "timing.raster.fifo", "values": [1, 4]}],
}


def test_a_sweep_is_the_command_line_s(splatsim_run, tmp_path):
    plan = {**PLAN, "scenes": [few(tmp_path)]}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    states = []
    rows = splatsim.sweep(plan, tmp_path / "ours", progress=lambda *state: states.append(state))
    splatsim_run("sweep", "plan.json", "--out", "theirs")
    theirs = parquet.read_table(tmp_path / "theirs/sweep.parquet")
    own = [name for name in theirs.column_names if not name.startswith("host_")]
    assert len(own) > 20 and rows.table.select(own).equals(theirs.select(own))
    assert states[-1][:2] == (4, 4)
    again = splatsim.sweep(plan, tmp_path / "ours").table
    assert again.equals(rows.table), "what is there is not drawn again"
    assert splatsim.sweep(plan).table.select(own).equals(theirs.select(own)), "without a folder"


def test_a_search_is_the_command_line_s(splatsim_run, tmp_path):
    (tmp_path / "scene.json").write_text(json.dumps({"splats": {"builtin": "glass-spheres", "count": 3000}}))
    scene = splatsim.Scene(tmp_path / "scene.json", size=(24, 16))
    found = splatsim.search(scene, "reference", target_psnr=40, only=["gauss.weight"], views=1, tries=5)
    options = ["--machine", "reference", "--target-psnr", 40, "--only", "gauss.weight", "--views", 1, "--tries", 5]
    splatsim_run("search", "scene.json", "--size", "24x16", *options, "--out", "theirs")
    machine = json.loads((tmp_path / "theirs/machine.json").read_text())
    assert found.found.dict() == machine
    assert found.table.num_rows == parquet.read_table(tmp_path / "theirs/search.parquet").num_rows
    # Another scene is outside of the search, and the report contains a warning.
    elsewhere = splatsim.run(splatsim.Scene("torus-knot", size=(24, 16)), found.found)
    assert elsewhere.report.machine.outside_of_search
