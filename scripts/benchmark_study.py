"""Seconds per case of a study of 200 cases against single solves, in one run: prints tables."""

from benchmarks.study_run import main
from reports.command import exit_with

if __name__ == "__main__":
    exit_with(main)
