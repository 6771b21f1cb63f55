"""Seconds and memory of the torque table of a million samples, beside a Python loop and Pinocchio."""

from benchmarks.torque_speed import main
from reports.command import exit_with

if __name__ == "__main__":
    exit_with(main)
