"""Instruction counts of the equations of motion of arms and their derivatives, beside other tools."""

from benchmarks.graph_counts import main
from reports.command import exit_with

if __name__ == "__main__":
    exit_with(main)
