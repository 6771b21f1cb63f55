"""Seconds per case of a study of 200 cases against single solves, in one run: prints tables."""

import sys

from benchmarks.study_run import main

if __name__ == "__main__":
    sys.exit(main())
