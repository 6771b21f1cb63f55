"""Seconds saved by compiled functions of an element, on the problems of the benchmark: prints a table."""

from benchmarks.compilation import main
from reports.command import exit_with

if __name__ == "__main__":
    exit_with(main)
