#!/usr/bin/env python3
"""Draws three scenes like those of Surface Splatting's Table 2, and prints this table for splatsim.

    cargo build --release
    python3 tests/programs/table_2.py target/release/splatsim ../shared/data [FOLDER] [--peer PEER]

The table is in docs/book/speed.md. The scenes are a scanned head, a textured terrain and a
helicopter with panes. Each is a mesh from which `sample` makes as many points as in the paper.
Frames per second of this computer are those of one thread; the simulated machine's are those of
`reference` with three fragments per pixel.

PEER is a folder with a program in C++ that draws discs in f32: `peer.cpp`, which reads seven
doubles per splat (position, normal, radius), and the headers that it needs in
`ac_types/include`. It draws the same discs from the same camera, all opaque and grey. If the folder
has `cputime.c`, a clock to be preloaded, its seconds are CPU seconds, which other processes disturb
little. Without PEER this column is left out.
"""

import argparse
import csv
import json
import multiprocessing
import os
import re
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

# Points, and the paper's frames per second at 256×256 and 512×512.
HEAD = (429_075, 1.3, 0.7)
TERRAIN = (4_782_011, 0.2, 0.1)
HELICOPTER = (987_552, 0.6, 0.3)
# The bust's up axis is z; the default camera's is y.
FACE = {"eye": [0, -1100, 0], "target": [0, 0, -15], "up": [0, 0, 1], "fov_y_degrees": 30}
# Bytes per fragment in the paper: 6.375 MiB at 256×256 with three fragments.
PAPERS_FRAGMENT = 34


def terrain(data: Path, path: Path) -> None:
    """A height field as a mesh with texture coordinates; samples are 0.1 units apart."""
    rows = [[float(cell) for cell in row if cell] for row in csv.reader(open(data / "terrain/vtkjs_dem.csv")) if row]
    height, width = len(rows), len(rows[0])
    with open(path, "w") as file:
        for y, row in enumerate(rows):
            for x, z in enumerate(row):
                file.write(f"v {x / 10} {z} {y / 10}\nvt {x / (width - 1)} {1 - y / (height - 1)}\n")
        for y in range(height - 1):
            for x in range(width - 1):
                a, b = y * width + x + 1, (y + 1) * width + x + 1
                file.write(f"f {a}/{a} {b}/{b} {a + 1}/{a + 1}\nf {b}/{b} {b + 1}/{b + 1} {a + 1}/{a + 1}\n")


def scene(cloud: Path, camera: dict | None) -> Path:
    """A scene of the cloud, with the default camera or a given one."""
    if camera is None:
        return cloud
    path = cloud.with_suffix(".json")
    path.write_text(json.dumps({"splats": {"file": cloud.name}, "camera": camera}))
    return path


def run(program: str, cloud: Path, side: int, folder: Path) -> tuple[dict, float, float]:
    """The report of a run, its elapsed seconds, and its peak memory in GB."""
    out = folder / f"{cloud.stem}-{side}"
    command = [program, "run", str(cloud), "--size", f"{side}x{side}", "--threads", "1", "--out", str(out), "--quiet"]
    started = os.times().elapsed
    child = subprocess.Popen(command)
    _, status, usage = os.wait4(child.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)} failed")
    return json.loads((out / "report.json").read_text()), os.times().elapsed - started, usage.ru_maxrss * 1024 / 1e9


# A point as written by `sample`: position, normal, colour, opacity, radius.
POINT = struct.Struct("<3d8f")
# A splat as read by the peer: position, normal, radius.
RAW = struct.Struct("<7d")
# Default depth threshold of a scene, in median radii.
THRESHOLD = 4
# Number of times that the peer draws a frame; the median is printed.
FRAMES = 5


def replaced(text: str, pattern: str, by: str) -> str:
    """Source of the peer with one changed constant."""
    changed, count = re.subn(pattern, lambda _: by, text)
    if count != 1:
        sys.exit(f"peer.cpp: {count} lines are like {pattern}, and one was expected")
    return changed


def peer_rate(peer: Path, cloud: Path, report: dict, side: int, folder: Path) -> float:
    """Frames per second of the peer: the cloud's discs, from the camera in the report."""
    head, _, points = cloud.read_bytes().partition(b"end_header\n")
    splats = [(*point[:6], point[10]) for point in POINT.iter_unpack(points)]
    if not splats or b"property float radius" not in head:
        sys.exit(f"{cloud}: no points as `sample` writes them")
    raw = folder / f"{cloud.stem}.raw"
    raw.write_bytes(b"".join(RAW.pack(*splat) for splat in splats))
    camera, listed = report["scene"]["camera"], lambda of: "{" + ", ".join(map(repr, of)) + "}"
    # The default of scenes.
    threshold = THRESHOLD * sorted(radius for *_, radius in splats)[len(splats) // 2]
    text = (peer / "peer.cpp").read_text()
    text = replaced(text, r"WIDTH = 512, HEIGHT = 512", f"WIDTH = {side}, HEIGHT = {side}")
    text = replaced(text, r"scale = 4;", "scale = 1;")
    at = [f"{name}[3] = {listed(camera[name])}" for name in ("eye", "target", "up")]
    text = replaced(text, r"double eye\[3\] = \{.*?\}, target\[3\] = \{.*?\}, up\[3\] = \{.*?\}", f"double {', '.join(at)}")
    text = replaced(text, r"40 \* M_PI / 360", f"{camera['fov_y_degrees']} * M_PI / 360")
    text = replaced(text, r"v\.near_ = 0\.01 \* scale", f"v.near_ = {camera['near']} * scale")
    text = replaced(text, r"v\.z_threshold = 0\.0016 \* scale", f"v.z_threshold = {threshold} * scale")
    source, built = folder / "peer.cpp", folder / "peer"
    source.write_text(text)
    subprocess.run(["g++", "-std=c++17", "-O3", "-march=native", f"-I{peer / 'ac_types/include'}", source, "-o", built], check=True)
    environment = dict(os.environ)
    if (peer / "cputime.c").exists():
        clock = (folder / "cputime.so").absolute()
        subprocess.run(["gcc", "-O2", "-shared", "-fPIC", peer / "cputime.c", "-o", clock], check=True)
        environment["LD_PRELOAD"] = str(clock)

    def seconds() -> float:
        told = subprocess.run([built, "float", raw], check=True, capture_output=True, text=True, env=environment).stdout
        return float(told.split()[1])

    return 1 / sorted(seconds() for _ in range(FRAMES))[FRAMES // 2]


def aside(function: Callable[..., float], *arguments: object) -> float:
    """Result of a function in a separate process, because the peak memory of a child includes that
    of its parent."""
    with multiprocessing.Pool(1) as pool:
        return pool.apply(function, arguments)


def main() -> None:
    parser = argparse.ArgumentParser(description="Table 2 of Surface Splatting again.")
    parser.add_argument("program")
    parser.add_argument("data", type=Path)
    parser.add_argument("folder", type=Path, nargs="?", default=Path("out/table-2"))
    parser.add_argument("--peer", type=Path, help="a folder with peer.cpp")
    parser.add_argument("--only", help="the one scene that is drawn")
    given = parser.parse_args()
    program, data, folder = given.program, given.data, given.folder
    folder.mkdir(parents=True, exist_ok=True)
    terrain(data, folder / "terrain.obj")
    scenes = [
        ("head", HEAD, [data / "scans/nefertiti.obj"]),
        ("helicopter", HELICOPTER, [data / "models/helicopter/helicopter.obj"]),
        ("terrain", TERRAIN, [folder / "terrain.obj", "--texture-image", data / "terrain/vtkjs_dem.jpg"]),
    ]
    f32 = "" if given.peer is None else " f32 |"
    print(f"| scene | points | size | the paper, frames/s | fixed | golden |{f32} simulated, frames/s | layers, the paper, MiB | here, MiB | memory, GB | s a run |")
    print(f"|---|---|---|---|---|---|{'---|' if f32 else ''}---|---|---|---|---|")

    def row(name: str, cloud: Path, points: int, side: int, paper: str) -> None:
        report, seconds, most = run(program, cloud, side, folder)
        host, pixels = report["host"], side * side
        rate = [1 / host[key] for key in ("fixed_seconds", "golden_seconds")]
        if given.peer is not None:
            rate.append(aside(peer_rate, given.peer, cloud.with_suffix(".ply"), report, side, folder))
        machine = report["machine"]
        layers = [3 * PAPERS_FRAGMENT * pixels, 3 * machine["fragment_bits"] / 8 * pixels]
        cells = [name, f"{points:,}", f"{side}²", paper, *(f"{of:.2f}" for of in rate)]
        cells += [f"{report['cycles']['frames_per_second']:.1f}", *(f"{bytes_ / 2**20:.2f}" for bytes_ in layers)]
        print(f"| {' | '.join([*cells, f'{most:.2f}', f'{seconds:.1f}'])} |", flush=True)

    for name, (points, *papers), mesh in scenes:
        if given.only not in (None, name):
            continue
        cloud = folder / f"{name}.ply"
        sample = [program, "sample", *mesh, "--points", points, "--pattern", "stratified", "--out", cloud, "--quiet"]
        subprocess.run([str(of) for of in sample], check=True)
        for side, paper in zip((256, 512), papers):
            row(name, scene(cloud, FACE if name == "head" else None), points, side, f"{paper}")
    # Time must not grow faster than the number of points.
    for part in (4, 2) if given.only is None else ():
        points = TERRAIN[0] // part
        cloud = folder / f"terrain-{part}.ply"
        sample = [program, "sample", *scenes[2][2], "--points", points, "--pattern", "stratified", "--out", cloud, "--quiet"]
        subprocess.run([str(of) for of in sample], check=True)
        row(f"terrain, 1/{part}", cloud, points, 512, "–")


main()
