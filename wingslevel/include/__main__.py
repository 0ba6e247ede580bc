"""Prints the folder of the C header."""

import sys

from wingslevel.include import get_include

sys.stdout.write(f"{get_include()}\n")
