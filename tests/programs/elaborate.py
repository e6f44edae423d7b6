"""Elaborate: elaborates SystemVerilog with slang (pyslang, from PyPI); exit status 1 on any error.

    elaborate.py ARGUMENT...

The arguments are those of slang's own command line: files, --top NAME, -D NAME=VALUE, -I FOLDER,
-y FOLDER. Every file is checked, also if the top does not use it.
"""

import shlex
import sys

from pyslang import driver

slang = driver.Driver()
slang.addStandardArgs()
# A shift by all bits of a word is well defined (IEEE 1800-2017, 11.4.10), and occurs at some
# widths.
arguments = ["slang", "-Werror", "-Wno-shift-count-overflow", *sys.argv[1:]]
if not (slang.parseCommandLine(shlex.join(arguments)) and slang.processOptions() and slang.parseAllSources()):
    sys.exit(1)
sys.exit(0 if slang.runFullCompilation(True) else 1)
