"""Seconds and memory of the torque table of a million samples, beside a Python loop and Pinocchio."""

import sys

from benchmarks.torque_speed import main

if __name__ == "__main__":
    sys.exit(main())
