"""RTL implementations on Icarus, compared with the live model. `python3 twins.py TRACE BUILD` runs them, as test_cocotb.py does; each in under twenty lines."""

import os
import re
import sys
from pathlib import Path

import cocotb

from splatsim import SplatsimError, Unit
from splatsim.cocotb import FAULTS, Bench

TRACE = Path(os.environ.get("SPLATSIM_TRACE", "."))


@cocotb.test()
async def gauss(dut):
    bench = Bench(dut, "gauss", TRACE, stalls=0.3)
    await bench.reset()
    await bench.send_random(600)
    await bench.finish()
    # A radial index is never below 0, although its word is signed.
    assert bench.coverage[0].missed() == [("radial", "least"), ("radial", "below 0")], bench.coverage[0].missed()


@cocotb.test()
async def resolve(dut):
    bench = Bench(dut, "resolve", TRACE, stalls=0.3)
    await bench.reset()
    await bench.send_random(600)
    await bench.finish()
    print(bench.coverage[0], bench.coverage[1])


@cocotb.test()
async def another_machine(dut):
    """A device that differs is detected: the model has another table."""
    bench = Bench(dut, "gauss", TRACE)
    bench.model = Unit("gauss", TRACE / "machine.json", TRACE / "scene.json", ["gauss.table.interpolation=linear"])
    first = []
    bench.monitor.listeners.append(lambda _: first or first.extend(bench.faults))
    await bench.reset()
    await bench.send_random(600)
    try:
        await bench.finish()
    except AssertionError as fault:
        assert "field weight is" in str(fault), fault
        # The fault names the time and the input record.
        assert re.match(r"at \d+ ns: gauss\.out: record ", str(fault)) and "of gauss.in: radial " in str(fault), fault
        assert len(bench.faults) == FAULTS and bench.faults[:1] == first, (first, bench.faults)
    else:
        assert False, "no fault was reported"


def refuses(trace):
    """Refuses numbers that C would truncate."""
    files = trace / "machine.json", trace / "scene.json"
    unit = Unit("gauss", *files)
    for call, message in [
        (lambda: unit.step({"radial": 1 << 64, "amplitude": 1}), "gauss.in: radial is 18446744073709551616"),
        (lambda: unit.step({"radial": 1, "amplitude": -(1 << 63) - 1}), "gauss.in: amplitude is -9223372036854775809"),
        (lambda: Unit("gauss", *files, seed=1 << 64), "seed is"),
        (lambda: Unit("gauss", *files, size=(1 << 32, 1)), "--size"),
    ]:
        try:
            call()
        except SplatsimError as fault:
            assert message in str(fault), fault
        else:
            assert False, f"{message}: not refused"


def main(trace, build):
    try:
        from cocotb_tools.runner import get_runner
    except ImportError:
        from cocotb.runner import get_runner
    rtl = Path(__file__).resolve().parents[3] / "rtl_model/rtl"
    trace = Path(trace).resolve()
    refuses(trace)
    os.environ["SPLATSIM_TRACE"] = str(trace)
    for unit, tests in [("gauss", ["gauss", "another_machine"]), ("resolve", ["resolve"])]:
        runner = get_runner("icarus")
        folder = Path(build).resolve() / unit
        runner.build(
            sources=[trace / "machine_pkg.sv", rtl / f"{unit}.sv"],
            hdl_toplevel=unit,
            build_args=["-g2012", "-y", str(rtl), "-Y", ".sv"],
            build_dir=folder,
            timescale=("1ns", "1ps"),
        )
        (folder / "rom").exists() or (folder / "rom").symlink_to(trace / "rom")
        results = runner.test(hdl_toplevel=unit, test_module="twins", testcase=tests, build_dir=folder, test_dir=folder)
        text = Path(results).read_text()
        assert "<failure" not in text and "<error" not in text, text
    print("twins: all well")


if __name__ == "__main__":
    main(*sys.argv[1:])
