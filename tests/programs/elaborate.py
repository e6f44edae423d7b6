"""Elaborate: has slang (pyslang, from PyPI) elaborate SystemVerilog, and ends with 1 where it finds anything wrong.

    elaborate.py ARGUMENT...

The arguments are those of slang's own command line: files, --top NAME, -D NAME=VALUE, -I FOLDER, -y FOLDER. Every file that is named is checked,
whether the top is built of it or not.
"""

import shlex
import sys

from pyslang import driver

slang = driver.Driver()
slang.addStandardArgs()
# A shift by all bits of a word has one meaning (IEEE 1800-2017, 11.4.10), and is what some widths leave of it.
arguments = ["slang", "-Werror", "-Wno-shift-count-overflow", *sys.argv[1:]]
if not (slang.parseCommandLine(shlex.join(arguments)) and slang.processOptions() and slang.parseAllSources()):
    sys.exit(1)
sys.exit(0 if slang.runFullCompilation(True) else 1)
