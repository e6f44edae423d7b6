#!/usr/bin/env python3
"""Compares the cycles of splatsim's memory with DRAMsim3 and Ramulator 2.1, on splatsim's requests.

    python3 tests/programs/dram.py WORK DRAMSIM3 RAMULATOR2 [--frames] [--debug]

DRAMSIM3 and RAMULATOR2 are folders of their sources, built (`make` in
github:umd-memsys/DRAMsim3; `cmake -DRAMULATOR_PYTHON_BINDINGS=OFF` and `make` of
github:CMU-SAFARI/ramulator2). WORK is a folder for traces and configurations. The example `dram`
draws three built-in scenes on `reference` with each preset, and writes every burst. The time of
memory alone is compared: every burst is issued as soon as there is room for it, with 32 in flight
per channel. With --frames the time of the frame is compared too: each burst is issued in the cycle
in which the machine issued it.
"""
import json
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCENES = ["glass-spheres", "checkerboard", "terrain"]

# Addresses from the highest bit: row, rank, group, bank, column, channel, as in the model.
INI = """[dram_structure]
{structure}
[timing]
{timing}
[power]
VDD = 1.2
IDD0 = 80
IPP0 = 4.0
IDD2P = 25
IDD2N = 34
IDD3P = 41
IDD3N = 47
IDD4W = 228
IDD4R = 243
IDD5AB = 280
IDD6x = 30
[system]
{system}
address_mapping = rorabgbacoch
queue_structure = PER_BANK
refresh_policy = RANK_LEVEL_STAGGERED
row_buf_policy = OPEN_PAGE
cmd_queue_size = 8
trans_queue_size = 32
[other]
epoch_period = 100000000
output_level = 0
"""


def fields(text):
    return "\n".join(pair.replace("=", " = ") for pair in text.split()) + "\n"


DRAMSIM3 = {
    # JESD209-4 for 3200 MT/s, two devices of 16 bits in parallel.
    "lpddr4-3200-x4": (
        0.625,
        4,
        "protocol=LPDDR4 bankgroups=1 banks_per_group=8 rows=65536 columns=1024 device_width=16 BL=16",
        "tCK=0.625 AL=0 CL=28 CWL=14 tRCD=29 tRP=29 tRAS=68 tRFC=448 tRFC2=448 tRFC4=448 tREFI=6246 tRPRE=1 tWPRE=1 tRRD_S=16 tRRD_L=16"
        " tWTR_S=16 tWTR_L=16 tFAW=64 tWR=29 tWR2=29 tRTP=12 tCCD_S=8 tCCD_L=8 tCKE=6 tCKESR=7 tXS=460 tXP=6 tRTRS=1 tPPD=4",
        "channel_size=2048 channels=4 bus_width=32",
    ),
    # DRAMsim3's own HBM2_8Gb_x128.ini.
    "hbm2": (
        1.0,
        8,
        "protocol=HBM bankgroups=4 banks_per_group=4 rows=32768 columns=64 device_width=128 BL=4 num_dies=4",
        "tCK=1 CL=14 CWL=4 tRCDRD=14 tRCDWR=14 tRP=14 tRAS=34 tRFC=260 tREFI=3900 tREFIb=128 tRPRE=1 tWPRE=1 tRRD_S=4 tRRD_L=6 tWTR_S=6"
        " tWTR_L=8 tFAW=30 tWR=16 tCCD_S=1 tCCD_L=2 tXS=268 tCKE=8 tCKSRE=10 tXP=8 tRTP_L=6 tRTP_S=4",
        "channel_size=1024 channels=8 bus_width=128",
    ),
}

RAMULATOR2 = {
    "ddr5-4800": (0.416, 2, 'GenericDDR(dram=r.dram.DDR5(org_preset="DDR5_16Gb_x8", timing_preset="DDR5_4800BN", rank=1)'),
    "lpddr5-6400-x4": (1.25, 4, 'LPDDR5(dram=r.dram.LPDDR5(org_preset="LPDDR5_8Gb_x16", timing_preset="LPDDR5_6400", rank=1)'),
    "hbm2": (1.0, 8, 'HBM12(dram=r.dram.HBM2(org_preset="HBM2_4Gb", timing_preset="HBM2_2000Mbps")'),
}

CONFIG = """import ramulator as r
def controller():
    return r.controller.{controller}, scheduler=r.scheduler.FRFCFS(), refresh_manager=r.refresh_manager.AllBank(),
        row_policy=r.row_policy.Open(), addr_mapper=r.addr_mapper.MOP4CLXOR())
memory = r.memory_system.GenericDRAM(clock_ratio=1, controllers=[controller() for _ in range({channels})],
    channel_mapper=r.channel_mapper.CacheLineInterleave())
r.Simulation(r.frontend.External(clock_ratio=1), memory)
"""


def run(*command, **more):
    return subprocess.run([str(part) for part in command], check=True, stdout=subprocess.PIPE, text=True, **more).stdout


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    work, dramsim3, ramulator2 = (Path(path).resolve() for path in sys.argv[1:4])
    work.mkdir(parents=True, exist_ok=True)
    # fmt and yaml-cpp are in the folders into which Ramulator's build fetched them.
    run("g++", "-O2", "-std=c++11", "-w", f"-I{dramsim3}/src", f"-I{dramsim3}/ext/fmt/include", f"-I{dramsim3}/ext/headers",
        "-DFMT_HEADER_ONLY=1", HERE / "dram_dramsim3.cc", dramsim3 / "libdramsim3.so", f"-Wl,-rpath,{dramsim3}", "-o", work / "dramsim3")
    run("g++", "-O2", "-std=c++20", "-w", f"-I{ramulator2}/src", f"-I{ramulator2}/ext/yaml-cpp/include", f"-I{ramulator2}/ext/fmt/include",
        HERE / "dram_ramulator2.cc", ramulator2 / "libramulator.so", f"-Wl,-rpath,{ramulator2}", "-o", work / "ramulator2")
    profile = [] if "--debug" in sys.argv else ["--release"]
    frames = "--frames" in sys.argv
    head = ["preset", "scene", "simulator", "memory alone, µs", "splatsim, µs", "off by"] + ["frame, µs", "splatsim, µs", "off by"] * frames
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|")
    for preset in dict.fromkeys([*DRAMSIM3, *RAMULATOR2]):
        folder = work / preset
        lines = run("cargo", "run", "-q", *profile, "--example", "dram", "--", folder, preset, *SCENES, cwd=HERE.parent.parent)
        simulators = []
        if preset in DRAMSIM3:
            tck, channels, structure, timing, system = DRAMSIM3[preset]
            config = folder / "dramsim3.ini"
            config.write_text(INI.format(structure=fields(structure), timing=fields(timing), system=fields(system)))
            simulators.append(("DRAMsim3", work / "dramsim3", config, lambda _: folder, tck, channels))
        if preset in RAMULATOR2:
            tck, channels, controller = RAMULATOR2[preset]
            script, config = folder / "ramulator2.py", folder / "ramulator2.yaml"
            script.write_text(CONFIG.format(controller=controller, channels=channels))
            run(sys.executable, "-m", "ramulator", "export", script, "-o", config, env={**os.environ, "PYTHONPATH": f"{ramulator2}/python"})
            simulators.append(("Ramulator 2.1", work / "ramulator2", config, lambda frame: frame["burst_bytes"], tck, channels))
        for line in lines.splitlines():
            frame = json.loads(line)
            cycle = 1e9 / frame["clock_hz"]
            for name, program, config, second, tck, channels in simulators:
                trace = folder / f"{frame['scene']}.trace"
                cells = []
                for of_trace, cycles in [(0, frame["memory_cycles"]), (cycle, frame["frame_cycles"])][: 1 + frames]:
                    theirs = float(run(program, config, second(frame), trace, of_trace, tck, channels).splitlines()[-1])
                    cells += [f"{theirs / 1000:.0f}", f"{cycles * cycle / 1000:.0f}", f"{100 * (cycles * cycle / theirs - 1):+.1f} %"]
                print(f"| `{preset}` | {frame['scene']} | {name} | {' | '.join(cells)} |", flush=True)


main()
