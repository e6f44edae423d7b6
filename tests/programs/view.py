"""View: tests the page of `splatsim view` in Chromium against docs/book/view.md.

    python tests/programs/view.py PROGRAM SCREENSHOTS [PICTURES_OF_THE_BOOK]

Needs Playwright's library (tests/programs/requirements.txt) and Debian's chromium. Ends with an
AssertionError if the page differs from its description. Expected values come from files and
commands, never from the page's own code. Seconds are printed but not checked.
"""

import contextlib
import csv
import hashlib
import json
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

from playwright.sync_api import sync_playwright

PROGRAM, SCREENSHOTS = sys.argv[1], pathlib.Path(sys.argv[2])
BOOK = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
SIZE = "96x80"


def splatsim(*arguments, cwd=None):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, (arguments, done.stderr)
    return done.stdout


@contextlib.contextmanager
def serving(folder):
    """Address of the page of a folder."""
    with subprocess.Popen([PROGRAM, "view", folder, "--no-open", "--seconds", "600"], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().strip()
        finally:
            process.kill()


class Pages:
    """Opens pages of a browser, and collects their errors."""

    def __init__(self, browser):
        self.browser, self.wrong, self.asked = browser, [], []

    @contextlib.contextmanager
    def open(self, address, width=1280, scheme="light", offline=False):
        context = self.browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme, offline=offline, accept_downloads=True)
        page = context.new_page()
        page.set_default_timeout(120_000)
        page.on("console", lambda message: self.wrong.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: self.asked.append(request.url))
        page.goto(address)
        page.wait_for_selector("[role=tab]")
        yield page
        assert not self.wrong, self.wrong
        context.close()


def keep(page, name, book=None, full=True):
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.wait_for_timeout(250)
    page.screenshot(path=SCREENSHOTS / f"{name}.png", full_page=full)
    if BOOK and book:
        BOOK.mkdir(parents=True, exist_ok=True)
        page.screenshot(path=BOOK / f"{book}.png", full_page=False)


def fits(page):
    # Pictures are redrawn for another width.
    until(page, lambda: page.evaluate("document.scrollingElement.scrollWidth <= innerWidth"))


def pressed(page, side):
    return page.locator(f"[aria-label='{side} picture'][role=group] [aria-pressed=true]").evaluate("button => button.firstChild.textContent")


def painted(page, nth=0):
    """Whether a pane shows more than one colour in its middle row."""
    return page.evaluate(
        """nth => { const canvas = document.querySelectorAll('.stage canvas')[nth];
        if (!canvas || !canvas.width) return false;
        const { data } = canvas.getContext('2d').getImageData(0, canvas.height / 2, canvas.width, 1);
        return new Set(new Uint32Array(data.buffer)).size > 3; }""",
        nth,
    )


def until(page, holds):
    end = time.monotonic() + 60
    while not holds():
        assert time.monotonic() < end, "waited in vain"
        page.wait_for_timeout(30)


def frame_is_shown(pages, folder, scene):
    report = json.loads((folder / "report.json").read_text())
    with serving(folder) as address, pages.open(address) as page:
        until(page, lambda: painted(page, 0) and painted(page, 1))
        assert [pressed(page, "left"), pressed(page, "right")] == ["fixed", "golden"]
        # Keys.
        page.keyboard.press("3")
        page.keyboard.press("Shift+Digit5")
        assert [pressed(page, "left"), pressed(page, "right")] == ["ideal", "flips"]
        for letter, mode in [("s", "slider"), ("o", "one"), ("t", "side by side")]:
            page.keyboard.press(letter)
            assert page.locator("button[aria-pressed=true]", has_text=mode).count() == 1, mode
        page.keyboard.press("1")
        page.keyboard.press("Shift+Digit2")
        # A click shows the pixel trace of `explain --json`.
        left, top, side = page.evaluate(
            """() => { const box = document.querySelector('.stage canvas').getBoundingClientRect();
            const scale = Math.min(box.width / %d, box.height / %d);
            return [box.left + box.width / 2 - scale * %d / 2, box.top + box.height / 2 - scale * %d / 2, scale]; }"""
            % (96, 80, 96, 80)
        )
        x, y = 50, 44
        page.mouse.click(left + (x + 0.5) * side, top + (y + 0.5) * side)
        page.wait_for_selector("#contributions")
        told = lambda x, y: json.loads(splatsim("explain", scene, "--size", SIZE, "--machine", "tiny", "--pixel", f"{x},{y}", "--json"))
        story_is(page, told(x, y))
        page.wait_for_selector(f"#values:has(h3:text-is('Pixel {x},{y}')) td:text-is('word, U1F8')")
        assert page.locator("#values").get_attribute("aria-live") == "polite"
        values = page.locator("#values table tr").evaluate_all("rows => rows.map(row => [...row.cells].map(cell => cell.textContent))")
        values = {row[0]: row[1:] for row in values}
        # Six decimals: half of the last one, and a margin for its own rounding.
        assert all(abs(float(shown) - value) <= 5.1e-7 for shown, value in zip(values["fixed"], told(x, y)["fixed"], strict=True)), values
        assert values["word, U1F8"] == [f"{word:x}" for word in told(x, y)["frame_words"]], values
        # Values under a moving pointer are not read aloud.
        page.mouse.move(left + (x + 3.5) * side, top + (y + 0.5) * side)
        page.wait_for_selector("#values[aria-live=off]")
        # Keys go to the focused element if it handles keys itself.
        for focused in ["summary", ".scroll", "#values .scroll"]:
            page.locator(f"#frame {focused}").first.focus()
            page.keyboard.press("o")
            assert page.locator("button[aria-pressed=true]", has_text="side by side").count() == 1, focused
        page.locator(".stage canvas").first.focus()
        # The printed command reproduces the pixel trace.
        command = shlex.split(page.locator("#command").text_content())
        assert command[:2] == ["splatsim", "explain"] and json.loads(splatsim(*command[1:], "--json")) == told(x, y)
        # Neighbours.
        page.keyboard.press("ArrowRight")
        page.keyboard.press("ArrowDown")
        page.wait_for_selector(f"#story h2:has-text('Pixel {x + 1},{y + 1}:')")
        story_is(page, told(x + 1, y + 1))
        # One request at a time, however fast pixels are chosen; the last one is shown.
        page.evaluate(
            """() => { const { json } = source; let open = 0;
            window.mostStories = 0;
            source.json = async path => {
              if (!path.startsWith('story')) return json(path);
              open += 1;
              window.mostStories = Math.max(window.mostStories, open);
              await new Promise(done => setTimeout(done, 600));
              return json(path).finally(() => { open -= 1; });
            }; }"""
        )
        for _ in range(4):
            page.keyboard.press("ArrowRight")
            page.wait_for_timeout(200)
        [page.keyboard.press("ArrowLeft") for _ in range(4)]
        page.wait_for_selector("#story:not([aria-busy])")
        until(page, lambda: page.evaluate("window.mostStories") > 0)
        page.wait_for_timeout(300)
        page.wait_for_selector(f"#story:not([aria-busy]) h2:has-text('Pixel {x + 1},{y + 1}:')")
        assert page.evaluate("window.mostStories") == 1
        # The worst pixel is the brightest one of the error picture.
        page.keyboard.press("w")
        until(page, lambda: page.evaluate("document.querySelector('#story h2')?.textContent.includes('Pixel 51,45:') === false"))
        worst = [int(number) for number in re.match(r"Pixel (\d+),(\d+)", page.locator("#story h2").text_content()).groups()]
        story = told(*worst)
        off = max(abs(a - b) for a, b in zip(story["fixed"][:3], story["golden"][:3]))
        assert off > 0.3 * report["accuracy"]["fixed_vs_golden"]["max_error"], (worst, off)
        until(page, lambda: painted(page))
        keep(page, "pixel-light-1280", book="frame", full=False)
        page.locator("#story").scroll_into_view_if_needed()
        page.evaluate("document.querySelector('#story').scrollIntoView()")
        # The screenshot must not show the scene's folder on this computer.
        page.evaluate("folder => { const shown = document.querySelector('#command'); shown.textContent = shown.textContent.replace(folder, ''); }", f"{scene.parent}/")
        keep(page, "story-light-1280", book="pixel", full=False)
        # A map, with its largest count.
        page.keyboard.press("8")
        page.wait_for_selector(".legend:has-text('contributions: 0')")
        most = page.evaluate("async () => Math.max(...new Float32Array(await (await fetch('map/contributions')).arrayBuffer()))")
        assert f" {most:.0f}" in page.locator(".legend", has_text="contributions: 0").first.text_content()
        keep(page, "map-light-1280")
        # Cycles of tiles over the picture, and the interval of the longest tile.
        tiles = list(csv.DictReader((folder / "tiles.csv").open()))
        longest = max(tiles, key=lambda tile: int(tile["cycles"]))
        page.keyboard.press("c")
        page.wait_for_selector(".legend:has-text('cycles: 0')")
        assert f" {float(longest['cycles']):,.0f}" in page.locator(".legend", has_text="cycles: 0").first.text_content()
        assert pressed(page, "left") == "cycles"
        keep(page, "cycles-light-1280")
        told_of = page.locator("#tile").text_content()
        tile = next(tile for tile in tiles if f"Tile {tile['column']},{tile['row']}:" in told_of)
        assert f"{int(tile['cycles']):,} cycles, {int(tile['entries']):,} splats" in told_of, told_of
        page.locator("#tile button").click()
        until(page, lambda: f"Tile {tile['column']},{tile['row']}: " in page.locator("#tile-says").text_content())
        page.locator("#tiles canvas").focus()
        page.keyboard.press("l")
        says = f"Tile {longest['column']},{longest['row']}: {int(longest['entries']):,} splats, {int(longest['cycles']):,} cycles, done in cycle {int(longest['done']):,}; busy: list {int(longest['list_busy']):,}"
        until(page, lambda: page.locator("#tile-says").text_content().startswith(says))
        keep(page, "tiles-light-1280", full=False)
        if BOOK:
            page.locator("#tiles").screenshot(path=BOOK / "tiles.png")
        # The machine.
        page.get_by_role("tab", name="Machine").click()
        page.wait_for_selector("#diagram .unit")
        units = page.locator("#diagram .unit").evaluate_all("units => units.map(unit => unit.dataset.unit)")
        assert sorted(units) == sorted(unit["name"] for unit in report["cycles"]["units"]), units
        until(page, lambda: "weight U-2F10" in page.locator("#diagram svg").text_content())
        page.locator("#diagram [data-unit=raster]").focus()
        page.keyboard.press("Enter")
        area = next(unit["area"] for unit in report["cost"]["units"] if unit["name"] == "raster")
        told_of = page.locator("#unit").text_content()
        assert told_of.startswith("raster") and f"{area:,.0f} LUT equivalents" in told_of and "Ranges" in told_of, told_of
        until(page, lambda: page.locator("#unit details").count() == sum(1 for signal in report["signals"] if signal["unit"] == "raster" and signal["words"]))
        until(page, lambda: page.locator("#timeline canvas").count() == 1 and page.locator("svg[aria-label=roofline]").count() == 1)
        # A unit that is a graph shows its words; a word shows its range.
        page.locator("#diagram [data-unit=project]").click()
        words = page.locator("svg.datapath .word").evaluate_all("words => words.map(word => word.dataset.word)")
        assert {"splat.position", "project.rotation", "project.camera", "project.slope", "project.pixel"} <= set(words), words
        assert page.locator("svg.datapath path").count() >= len(words) - 1
        camera = page.locator("svg.datapath [data-word='project.camera']")
        said = camera.get_attribute("aria-label")
        assert re.search(r"project.camera I2F\d+: [\d,]+ words, \d+ of \d+ bits used", said), said
        ranges = page.locator("#unit details[data-signal='project.camera']")
        before = ranges.evaluate("details => details.open")
        camera.focus()
        page.keyboard.press("Enter")
        assert not before and ranges.evaluate("details => details.open")
        page.locator("#diagram [data-unit=raster]").click()
        assert page.locator("svg.datapath").count() == 0
        keep(page, "machine-light-1280")
        # Tabs by keyboard.
        page.get_by_role("tab", name="Machine").focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_selector("#charts img")
        page.keyboard.press("ArrowLeft")
        page.keyboard.press("ArrowLeft")
        assert page.locator("#frame").is_visible()
        # A narrow window, then a wide one.
        page.set_viewport_size({"width": 390, "height": 900})
        page.evaluate("scrollTo(0, 0)")
        until(page, lambda: painted(page))
        fits(page)
        keep(page, "frame-light-390")
        for scheme in ["dark", "light"]:
            page.emulate_media(color_scheme=scheme)
            page.get_by_role("tab", name="Machine").click()
            fits(page)
            keep(page, f"machine-{scheme}-390")
        page.set_viewport_size({"width": 1280, "height": 900})
        page.emulate_media(color_scheme="dark")
        keep(page, "machine-dark-1280")
        page.get_by_role("tab", name="Frame").click()
        until(page, lambda: painted(page))
        keep(page, "frame-dark-1280")
    # No other client reads it.
    with serving(folder) as address:
        context = pages.browser.new_context()
        page = context.new_page()
        assert page.goto(address.rsplit("/", 2)[0] + "/").status == 403
        page.goto("data:text/html,<p>elsewhere")
        assert page.evaluate("address => fetch(address).then(() => 'read', () => 'refused')", address + "folder") == "refused"
        context.close()


def story_is(page, story):
    """Checks the page against the output of `explain --json`."""
    rows = page.locator("#contributions tbody tr").evaluate_all("rows => rows.map(row => [row.className, ...[...row.cells].map(cell => cell.textContent)])")
    assert len(rows) == min(500, len(story["contributions"])) and rows, len(rows)
    for row, one in zip(rows, story["contributions"]):
        expected = [str(one["splat"])]
        for whose in ["fixed", "golden"]:
            of = one[whose]
            expected += [f"{of['radial_index']:.5f}", f"{of['weight']:.6f}", f"{of['z']:.5f}", of["decision"]] if of else ["–", "–", "–", "none"]
        close = all(a == b or abs(float(a) - float(b)) < 2e-5 for a, b in zip(row[2:-1], expected))
        assert close and (row[0] == "flip") == one["flip"], (row, expected)
    drawn = sum((one["fixed"] is not None) + (one["golden"] is not None) for one in story["contributions"] if one["flip"])
    until(page, lambda: page.locator("#story svg[aria-label^='slots over time'] .flip").count() == drawn)


LESS, MORE = "area", ["fixed_vs_ideal_psnr_db", "frames_per_second"]


def beats(a, b):
    """Whether a row is at least as good as another in all three figures, and better in one."""
    pairs = [(-float(a[LESS]), -float(b[LESS]))] + [(float(a[name]), float(b[name])) for name in MORE]
    return all(x >= y for x, y in pairs) and any(x > y for x, y in pairs)


def sweep_is_shown(pages, folder, machine):
    with (folder / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    with serving(folder) as address, pages.open(address) as page:
        page.wait_for_selector(".rows tbody tr")
        until(page, lambda: page.evaluate("rowsPlots.every(plot => plot.uplot())"))
        page.wait_for_timeout(150)
        shown = lambda: set(page.locator(".rows tbody tr").evaluate_all("rows => rows.map(row => Number(row.dataset.row))"))
        assert shown() == set(range(len(rows)))
        front = [row for row in rows if not any(beats(other, row) for other in rows)]
        until(page, lambda: page.get_by_role("button", name=f"front of three ({len(front)})").count() == 1)
        # The line through the rows that no other row beats in both axes.
        for axes, on_line in page.evaluate("rowsPlots.map(plot => [plot.names, plot.front()])"):
            good = lambda row: [float(row[name]) * (-1 if name == LESS else 1) for name in axes]
            pairs = [good(row) for row in rows]
            best = {nth for nth, (a, b) in enumerate(pairs) if not any(x >= a and y >= b and (x > a or y > b) for x, y in pairs)}
            assert set(on_line) == best and len(on_line) == len(best), (axes, on_line, best)
        # A brush in the first plot, in pixels; the rows inside it follow from the ends of the axes.
        box, ends = page.evaluate(
            """() => { const { over, scales: { x, y } } = rowsPlots[0].uplot(), { left, top, width, height } = over.getBoundingClientRect();
            return [[left, top, width, height], [x.min, x.max, y.min, y.max]]; }"""
        )
        parts = (0.05, 0.01, 0.62, 0.8)
        from_x, from_y, to_x, to_y = (box[axis % 2] + part * box[2 + axis % 2] for axis, part in enumerate(parts))
        page.mouse.move(from_x, from_y)
        page.mouse.down()
        page.mouse.move((from_x + to_x) / 2, (from_y + to_y) / 2, steps=3)
        page.mouse.move(to_x, to_y)
        page.mouse.up()
        x_at = lambda pixel: ends[0] + (pixel - box[0]) / box[2] * (ends[1] - ends[0])
        y_at = lambda pixel: ends[3] - (pixel - box[1]) / box[3] * (ends[3] - ends[2])
        inside = lambda row: x_at(from_x) <= float(row["area"]) <= x_at(to_x) and y_at(to_y) <= float(row["fixed_vs_ideal_psnr_db"]) <= y_at(from_y)
        expected = {nth for nth, row in enumerate(rows) if inside(row)}
        until(page, lambda: shown() == expected)
        assert 0 < len(expected) < len(rows)
        until(page, lambda: page.locator("#count").text_content() == f"{len(expected)} of {len(rows)} rows")
        keep(page, "sweep-light-1280", book="sweep", full=False)
        page.keyboard.press("Escape")
        assert len(shown()) == len(rows)
        # A filter of words and a number.
        middle = sorted(float(row["area"]) for row in rows)[len(rows) // 2]
        page.locator("input[type=search]").fill(f"area<{middle}")
        assert shown() == {nth for nth, row in enumerate(rows) if float(row["area"]) < middle}
        page.locator("input[type=search]").fill(f"area<{middle} fragment.layers=1")
        assert shown() == {nth for nth, row in enumerate(rows) if float(row["area"]) < middle and row["fragment.layers"] == "1"}
        page.get_by_role("button", name="all rows").click()
        # Sorted by a column's heading.
        page.locator("th[data-column=area] button").click()
        page.locator("th[data-column=area] button").click()
        first = int(page.locator(".rows tbody tr").first.get_attribute("data-row"))
        assert float(rows[first]["area"]) == max(float(row["area"]) for row in rows)
        # A machine chosen by keyboard: its flags and its file must describe the same machine.
        page.locator(".rows tbody tr").first.focus()
        page.keyboard.press("Enter")
        assert "--set 'timing.raster.lanes=[" in page.locator(".flags").text_content()
        flags = shlex.split(page.locator(".flags").text_content())
        with page.expect_download() as download:
            page.locator(".save").click()
        file = folder / "described.json"
        download.value.save_as(file)
        shown_by = lambda *arguments: {**json.loads(splatsim("machine", "show", *arguments)), "name": ""}
        assert flags and shown_by(file) == shown_by(machine, *flags)
        # Two rows next to each other.
        page.locator(".rows tbody tr").nth(3).click(modifiers=["Shift"])
        heads = page.locator("#figures th").all_text_contents()
        assert heads == ["", "A", "B", "B − A"], heads
        other = int(page.locator(".rows tbody tr").nth(3).get_attribute("data-row"))
        cells = page.locator("#figures tr", has=page.locator("td:text-is('energy_j')")).locator("td").all_text_contents()
        assert [float(cell) for cell in cells[1:3]] == [float(f"{float(rows[row]['energy_j']):.6g}") for row in (first, other)], cells
        keep(page, "compared-light-1280")
        page.set_viewport_size({"width": 390, "height": 900})
        page.emulate_media(color_scheme="dark")
        page.wait_for_timeout(200)
        fits(page)
        keep(page, "sweep-dark-390")


def many_rows(folder, base):
    """A folder with 10,000 rows in the format of `sweep`."""
    folder.mkdir()
    columns = json.loads((base / "points.jsonl").read_text().splitlines()[0])
    _, like = json.loads((base / "points.jsonl").read_text().splitlines()[1])
    names = [column.split(": ")[0] for column in columns]
    with (folder / "points.jsonl").open("w") as file:
        file.write(json.dumps(columns, separators=(",", ":"), ensure_ascii=False) + "\n")
        for point in range(10_000):
            row = list(like)
            row[0] = point
            hashed = int(hashlib.sha256(str(point).encode()).hexdigest()[:12], 16)
            for name, least, spread in [("area", 50_000, 100_000), ("frames_per_second", 20, 90), ("fixed_vs_ideal_psnr_db", 25, 30), ("psnr_db", 40, 50), ("cycles", 10**6, 10**7)]:
                row[names.index(name)] = least + hashed % spread + (0.5 if name != "cycles" else 0)
                hashed //= 7
            # The format of the program's journal; the text of a number does not change when it is
            # read and written again.
            cells = "[" + ",".join(json.dumps(cell, ensure_ascii=False) for cell in row) + "]"
            file.write(f'["{hashlib.sha256(cells.encode()).hexdigest()[:24]}",{cells}]\n')
    shutil.copy(base / "plan.json", folder)


def many_rows_are_shown(pages, folder):
    with serving(folder) as address:
        start = time.monotonic()
        with pages.open(address) as page:
            page.wait_for_selector(".rows tbody tr")
            until(page, lambda: page.evaluate("rowsPlots.every(plot => plot.uplot())"))
            page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
            print(f"10,000 rows are drawn {time.monotonic() - start:.2f} s after the browser is asked for the page")
            until(page, lambda: page.locator("#count").text_content() == "10,000 rows")
            keep(page, "many-light-1280")


def others_are_shown(pages, folder):
    """Folders of `replay` and `stress`."""
    splatsim("replay", folder / "work", "--out", folder / "replayed")
    splatsim("stress", "--case", "lone-splats", "--out", folder / "stressed", "--quiet")
    with serving(folder / "replayed") as address, pages.open(address) as page:
        assert page.locator("[role=tab]").all_text_contents() == ["Machine", "Charts"]
        until(page, lambda: page.locator("#diagram .unit").count() > 5)
    with serving(folder / "stressed") as address, pages.open(address) as page:
        assert page.locator("[role=tab]").all_text_contents() == ["Stress cases", "Charts"]
        points = sum(len(machine["points"]) for case in json.loads((folder / "stressed/stress.json").read_text())["cases"] for machine in case["machines"])
        until(page, lambda: page.locator("#count").text_content() == f"{points} rows")
        keep(page, "stress-light-1280")


def sequence_is_shown(pages, folder):
    report = json.loads((folder / "report.json").read_text())
    with serving(folder) as address, pages.open(address) as page:
        says = lambda: page.locator("#frame-says").text_content()
        until(page, lambda: says().startswith(f"Frame 0 of {len(report['frames'])}: {report['frames'][0]['cycles']:,} cycles"))
        drawn = lambda: page.evaluate("[...document.querySelectorAll('#sequence canvas')].map(canvas => canvas.toDataURL())")
        until(page, lambda: len(set(drawn())) > 1)
        before = drawn()
        page.keyboard.press("ArrowRight")
        until(page, lambda: says().startswith("Frame 1 of") and drawn() != before)
        assert f"against frame_0001_ideal.png: golden {figure(report['frames'][1]['against']['golden']['psnr_db'], 4)} dB" in says(), says()
        against_is_shown(page, report["against"])
        assert page.locator("tr", has_text="infinite").count() == 1
        jumps = report["frames"][1]["flicker"]["golden_vs_ideal"]["jumps"]
        assert f"golden − ideal {float(f'{100 * jumps:.3g}'):g} % of" in says(), (jumps, says())
        page.keyboard.press("ArrowLeft")
        until(page, lambda: drawn() == before)
        page.get_by_role("button", name="play").click()
        until(page, lambda: says().startswith("Frame 2 of"))
        page.get_by_role("button", name="play").click()
        keep(page, "sequence-light-1280")
        page.get_by_role("tab", name="Rows").click()
        until(page, lambda: page.locator(".rows tbody tr").count() == len(report["frames"]))


def figure(value, digits):
    return f"{float(f'{value:.{digits}g}'):g}"


def against_is_shown(page, told):
    """Checks the table of golden and fixed against photographs with the report."""
    rows = page.locator("table", has_text="FLIP").locator("tbody tr").evaluate_all("rows => rows.map(row => [...row.cells].map(cell => cell.textContent))")
    assert [row[0] for row in rows] == ["golden", "fixed", "fixed − golden"], rows
    for row, of in zip(rows, ["golden", "fixed", "fixed_minus_golden"]):
        for cell, name, digits in zip(row[1:], ["psnr_db", "ssim", "flip"], [3, 5, 5]):
            if told[of][name] is not None:
                assert abs(float(cell.replace("−", "-")) - told[of][name]) <= 0.51 * 10**-digits, (row, told[of])


def photograph_is_shown(pages, folder):
    with serving(folder) as address, pages.open(address) as page:
        until(page, lambda: page.get_by_text("Against ideal.png, code values of 8 bits:").count() == 1)
        against_is_shown(page, json.loads((folder / "report.json").read_text())["against"])
        keep(page, "against-light-1280")


def comparison_is_shown(pages, folder):
    told = json.loads((folder / "compare.json").read_text())
    with serving(folder) as address, pages.open(address) as page:
        until(page, lambda: page.evaluate("[...document.querySelectorAll('#compare img')].filter(image => image.naturalWidth).length") == 3)
        figures = {figure["name"]: figure for figure in told["figures"]}
        row = page.locator("#compare tr", has_text="memory, MB per frame").locator("td").all_text_contents()
        shown, bytes_ = float(row[1].replace(",", "")), figures["memory, MB per frame"]["a"]
        assert abs(shown - bytes_ / 1e6) <= 1e-5 * shown, (row, bytes_)
        cycles = page.locator("#compare tr", has_text="cycles").first.locator("td").all_text_contents()
        assert [int(cell.replace(",", "")) for cell in cycles[1:3]] == [figures["cycles"]["a"], figures["cycles"]["b"]], cycles
        fields = page.locator("#compare tr", has_text="timing.shade.latency").count()
        assert fields == 1 and told["machine"][0]["field"] == "timing.shade.latency"
        keep(page, "compare-light-1280")
        page.set_viewport_size({"width": 390, "height": 800})
        fits(page)


def equal_pictures_are_best(pages, folder):
    """A row with an infinite PSNR (null) and error 0 beats all others in accuracy; a row that was not
    drawn has neither, and is not shown."""
    folder.mkdir()
    names = ["area", "psnr_db", "max_error", "frames_per_second"]
    rows = [[10, None, 0, 6], [10, 50, 0.1, 5], [10, 45, 0.1, 6], [5, 40, 0.2, 5.5], [2, None, None, 9]]
    (folder / "choices.json").write_text(json.dumps({"choices": [dict(zip(names, row)) for row in rows]}))
    with serving(folder) as address, pages.open(address) as page:
        page.get_by_role("button", name="front of three (2)").click()
        assert page.locator(".rows tbody tr").evaluate_all("rows => rows.map(row => row.dataset.row)") == ["0", "3"]


def what_throws_is_a_sentence(pages, run, folder):
    """A report of another version, without the fields that the page shows."""
    shutil.copytree(run, folder)
    report = json.loads((folder / "report.json").read_text())
    del report["accuracy"]["lockstep"]
    (folder / "report.json").write_text(json.dumps(report))
    with serving(folder) as address, pages.open(address) as page:
        page.keyboard.press("5")
        until(page, lambda: painted(page, 0))
    del report["accuracy"]["golden_vs_ideal"]
    (folder / "report.json").write_text(json.dumps(report))
    with serving(folder) as address, pages.open(address) as page:
        told = page.locator("#frame .wrong").text_content()
        assert told.startswith("This cannot be shown: ") and told.endswith(". Was it written by another version?"), told
        page.get_by_role("tab", name="Machine").click()
        until(page, lambda: page.locator("#diagram .unit").count() > 5)


def exports_need_nothing(pages, run, rows):
    for folder in [run, rows]:
        file = folder.parent / f"{folder.name}.html"
        splatsim("view", folder, "--export", file)
        pages.asked.clear()
        with pages.open(file.as_uri(), offline=True) as page:
            if folder is run:
                until(page, lambda: painted(page, 0) and painted(page, 1))
                page.locator(".stage canvas").first.click()
                page.wait_for_selector("#values table")
                until(page, lambda: "8 bits" in page.locator("#values").text_content())
                assert page.locator("#command").text_content().startswith("splatsim explain ")
                assert page.get_by_role("button", name="layers").count() == 0
                page.get_by_role("tab", name="Machine").click()
                until(page, lambda: page.locator("#diagram .unit").count() > 5)
                page.get_by_role("tab", name="Charts").click()
                until(page, lambda: page.locator("#charts img").first.evaluate("image => image.naturalWidth > 0"))
            else:
                page.wait_for_selector(".rows tbody tr")
                until(page, lambda: page.evaluate("rowsPlots.every(plot => plot.uplot())"))
            keep(page, f"export-{folder.name}")
        elsewhere = [url[:80] for url in pages.asked if not url.startswith(("data:", "blob:")) and url.split("#")[0] != file.as_uri()]
        assert not elsewhere, elsewhere


def main():
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = pathlib.Path(name)
        scene = folder / "few spheres.json"
        scene.write_text('{"splats": {"builtin": "glass-spheres", "count": 6000}}')
        plan = folder / "plan.json"
        fields = [{"field": "gauss.weight", "add_frac_bits": [-4, 0]}, {"field": "fragment.layers", "range": [1, 4, 1]}, {"field": "timing.raster.lanes", "values": [[2, 2], [4, 1]]}]
        plan.write_text(json.dumps({"scenes": [scene.name], "size": [40, 32], "machine": "lean", "axes": fields}))
        splatsim("run", scene, "--size", SIZE, "--machine", "tiny", "--quiet", "--out", folder / "run", "--record", folder / "work")
        splatsim("sweep", plan, "--quiet", "--out", folder / "rows")
        pan = folder / "pan.json"
        camera = {"eye": [0, 1.2, 4.5], "target": [0, -0.2, 0], "up": [0, 1, 0], "fov_y_degrees": 45, "near": 0.05}
        pan.write_text(json.dumps({"splats": {"builtin": "glass-spheres", "count": 6000}, "camera_path": {"pan_pixels": 0.0625, "frames": 3, "camera": camera}}))
        splatsim("run", pan, "--size", SIZE, "--machine", "tiny", "--quiet", "--out", folder / "pan")
        # Photographs: golden's picture for one frame, ideal's for the others.
        (folder / "photographs").mkdir()
        for frame, kind in enumerate(["golden", "ideal", "ideal"]):
            shutil.copy(folder / f"pan/frame_{frame:04}_{kind}.png", folder / "photographs")
        splatsim("run", pan, "--size", SIZE, "--machine", "tiny", "--quiet", "--out", folder / "pan", "--against", folder / "photographs")
        splatsim("run", scene, "--size", SIZE, "--machine", "tiny", "--quiet", "--check", "sampled", "--out", folder / "against", "--against", folder / "run/ideal.png")
        splatsim("compare", "tiny", "tiny", "--set-b", "timing.shade.latency=30", "--scene", scene, "--size", SIZE, "--out", folder / "compared")
        many_rows(folder / "many", folder / "rows")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        pages = Pages(browser)
        questions = [
            (frame_is_shown, folder / "run", scene),
            (sweep_is_shown, folder / "rows", "lean"),
            (many_rows_are_shown, folder / "many"),
            (others_are_shown, folder),
            (sequence_is_shown, folder / "pan"),
            (photograph_is_shown, folder / "against"),
            (comparison_is_shown, folder / "compared"),
            (equal_pictures_are_best, folder / "equal"),
            (what_throws_is_a_sentence, folder / "run", folder / "older"),
            (exports_need_nothing, folder / "run", folder / "rows"),
        ]
        for question, *arguments in questions:
            start = time.monotonic()
            question(pages, *arguments)
            print(f"{time.monotonic() - start:5.1f} s  {question.__name__}")
        browser.close()


main()
