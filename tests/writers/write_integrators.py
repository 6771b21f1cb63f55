"""Write docs/integrators.md, measured orders and long-time energy: python tests/writers/write_integrators.py."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.extend(str(Path(__file__).resolve().parents[2] / folder) for folder in ("tests", "scripts"))

from integrators.test_integrators import FIXED, energy_errors, measured_order

PAGE = Path(__file__).resolve().parents[2] / "docs" / "integrators.md"
HEAD = """# Integrators, measured

`python tests/writers/write_integrators.py` writes this page; the tests hold every order to the theory within 0.35.

`simulate(system, x0, control, times, method=...)` takes any of `ocp.integrators`. With error control: `extrapolation`
(order 16, the default), `dormand_prince_5`, `dormand_prince_8`, `radau_5` (stiff), `adams` and `bdf` (CVODES). With
steps of one width: those of the table. All steps end where the control jumps.

Where the fastest mode of a system dies out far faster than the motion, the default goes on with `radau_5` at its own
tolerances; a fast mode that swings is followed. An integrator that runs out of steps names that mode and what to use
instead. Methods with steps of one width have no error control: too long a step is noticed only if the states overflow.

## Orders

H = p^2 (1 + q^2 / 2) / 2 - cos q - u q with u = 0.3 cos 2t over 2 s, regression of the errors over four steps, against
the default integrator at 1e-13.

| integrator | measured / theory | error at the longest and shortest step |
|---|---|---|
"""
ENERGY = """
## Energy over 1e5 steps

Free motion of the torus-like manipulator with gravity, canonical form in the frame `coordinate`, steps of 0.01 s; the
energy at the start is -240 J. Largest error [J] in the first and in the last tenth of the steps:

| integrator | first tenth | last tenth | |
|---|---|---|---|
"""
WHERE = """
`gauss` (any number of stages) and `stoermer_verlet` are symplectic, (dy/dx)' W (dy/dx) = W to 2e-14 for one step, for
the canonical form in the frame `coordinate`: every machine, with or without gravity and payload, with drive forces that
are given functions of time. `gauss` is so too in a frame with constant F, such as `regular` of `cylindrical` and of
`torus`, since it commutes with linear maps. In a frame that varies (`regular` of `spherical`, `ldl`, `udu`) the
structure matrix depends on the state and no Runge-Kutta method keeps it; `stoermer_verlet` refuses such a system. With
friction or feedback there is no symplectic structure. Steps must be equal: report at multiples of the step.

The trapezoid rule with many corrections does not drift either: the implicit trapezoid rule is conjugate to the
implicit midpoint rule, `gauss(1)`. With the one or two corrections of hand calculation it drifts.
"""
MEASURED = (
    "gauss(1), implicit midpoint", "gauss(2)", "gauss(3)", "stoermer_verlet", "runge_kutta_4", "heun",
    "predictor_corrector, 2 corrections", "predictor_corrector, 5 corrections", "radau_iia(2)", "radau_iia(3)",
)  # fmt: skip


def main() -> None:
    """Measure and write."""
    rows = []
    for name, (make, order, counts) in FIXED.items():
        measured, errors = measured_order(make, counts)
        rows.append(f"| `{name}` | {measured:.2f} / {order} | {errors[0]:.1e}, {errors[-1]:.1e} |\n")
    energy = []
    for name in MEASURED:
        errors = energy_errors(FIXED[name][0], 0.01)
        word = "bounded" if errors[-1] < 1.3 * errors[0] else f"{errors[-1] / errors[0]:.0f} times"
        energy.append(f"| `{name}` | {errors[0]:.1e} | {errors[-1]:.1e} | {word} |\n")
    PAGE.write_text(HEAD + "".join(rows) + ENERGY + "".join(energy) + WHERE, encoding="utf-8")


if __name__ == "__main__":
    main()
