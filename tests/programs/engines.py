"""Engines: frames a second and area of 1 to 16 tile engines, on scenes, each drawn once and replayed.

    python tests/programs/engines.py PROGRAM OUT SCENE [SCENE ...] [-- FLAG ...]

Prints a table and writes OUT/engines.svg. FLAGs go to `run` and `replay`, as in `-- --set timing.memory.bytes_per_cycle=64`.
"""

import json
import pathlib
import subprocess
import sys

PROGRAM, OUT, *SCENES = sys.argv[1:]
SCENES, FLAGS = (SCENES[: SCENES.index("--")], SCENES[SCENES.index("--") + 1 :]) if "--" in SCENES else (SCENES, [])
OUT = pathlib.Path(OUT)
ENGINES = [1, 2, 4, 8, 16]
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7"]


def splatsim(*arguments):
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def measured(scene):
    """Frames a second, area, and what limits the frame, for each count of engines."""
    folder = OUT / pathlib.Path(scene).stem
    record = OUT / f"{folder.name}.work"
    splatsim("run", scene, "--out", folder, "--record", record, *FLAGS)
    for engines in ENGINES:
        splatsim("replay", record, "--set", f"timing.engines={engines}", "--out", folder, *FLAGS)
        report = json.loads((folder / "report.json").read_text())
        yield report["cycles"]["frames_per_second"], report["cost"]["area"], report["cycles"]["bottleneck"]


def chart(rows):
    """Frames a second over area, a line a scene."""
    points = [point for row in rows.values() for point in row]
    widest, fastest = max(area for _, area, _ in points), max(rate for rate, _, _ in points)
    place = lambda rate, area: (60 + 520 * area / widest, 340 - 310 * rate / fastest)
    lines = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 640 400" font-family="sans-serif" font-size="12">',
             '<rect width="640" height="400" fill="white"/><path d="M60 20V340H590" fill="none" stroke="black"/>',
             f'<text x="60" y="14">{fastest:.0f} frames/s</text><text x="590" y="358" text-anchor="end">{widest / 1e6:.1f} million LUT equivalents</text>']
    for nth, (name, row) in enumerate(rows.items()):
        places = [place(rate, area) for rate, area, _ in row]
        colour = COLOURS[nth % len(COLOURS)]
        lines.append(f'<polyline fill="none" stroke="{colour}" stroke-width="2" points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in places)}"/>')
        lines += [f'<text x="{x + 4:.1f}" y="{y - 5:.1f}">{engines}</text>' for engines, (x, y) in zip(ENGINES, places)]
        lines.append(f'<text x="{70 + 180 * nth}" y="385" fill="{colour}">{name}</text>')
    (OUT / "engines.svg").write_text("\n".join([*lines, "</svg>", ""]))


OUT.mkdir(parents=True, exist_ok=True)
ROWS = {pathlib.Path(scene).stem: list(measured(scene)) for scene in SCENES}
print("| engines | area | " + " | ".join(ROWS) + " |")
print("|---|---|" + "---|" * len(ROWS))
for nth, engines in enumerate(ENGINES):
    area = next(iter(ROWS.values()))[nth][1]
    rates = [f"{row[nth][0]:.1f} ({row[nth][2]})" for row in ROWS.values()]
    print(f"| {engines} | {area:,.0f} | " + " | ".join(rates) + " |")
chart(ROWS)
