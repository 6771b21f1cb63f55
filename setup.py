"""Packages of the installation: ocp, models, and the commands as hamel_commands; all else stands in pyproject.toml."""

from setuptools import find_packages, setup

commands = ["hamel_commands", *(f"hamel_commands.{room}" for room in find_packages("scripts"))]
setup(
    packages=[*find_packages(include=["ocp*", "models*"]), *commands],
    package_dir={"hamel_commands": "scripts"},
)
