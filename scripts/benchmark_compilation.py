"""Seconds saved by compiled functions of an element, on the problems of the benchmark: prints a table."""

import sys

from benchmarks.compilation import main

if __name__ == "__main__":
    sys.exit(main())
