"""The Manutec r3 against another program: PSOPT (V. M. Becerra), example manutec, output in its files."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import pytest

from models import robots
from models.effects import Gravity
from models.forms import canonical
from ocp import Bolza, Fixed, point_to_point, polish, solve_to_accuracy, verify

PSOPT_ENERGY = 20.40419  # [V^2 s] in 0.53 s, 49 Legendre nodes


@pytest.mark.slow
def test_least_energy_of_a_quarter_turn_is_that_of_another_program() -> None:
    machine = robots.manutec_r3()
    arm = canonical(machine, [Gravity()])
    volts = ca.vertcat(arm["tau"][0] / 126.0, arm["tau"][1] / 252.0, arm["tau"][2] / 72.0)
    task = point_to_point(arm, (0.0, -1.5, 0.0), (1.0, -1.95, 1.0), limits=machine.limits)
    task = replace(task, horizon=Fixed(0.53), minimise=Bolza(running=ca.sumsqr(volts)))
    *_, refined = solve_to_accuracy(task, 1e-5)
    polished = polish(refined)
    assert polished.structure is not None, polished.message
    assert verify(polished).ok
    assert polished.cost == pytest.approx(refined.cost, abs=1e-5)
    assert polished.cost == pytest.approx(PSOPT_ENERGY, rel=1e-5)
