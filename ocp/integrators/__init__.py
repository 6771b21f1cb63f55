"""The integrators by their names: each function returns the settings that `simulate` takes as `method`.

With error control: `extrapolation` (order 16, implicit where stiff, the default of `simulate`), `dormand_prince_8` and
`dormand_prince_5` (explicit), `radau_5` (implicit, stiff), `adams` and `bdf` (multistep, in compiled code). With steps
of one width: `euler`, `heun`, `runge_kutta_4`, `predictor_corrector`, `gauss` and `stoermer_verlet` (symplectic),
`radau_iia` (stiff). A rule or tableau of one's own goes into `FixedStep` or `AdaptiveStep` directly.
"""

from __future__ import annotations

from ocp.checks import Array
from ocp.integrators import tableaux
from ocp.integrators.adaptive_step import AdaptiveStep
from ocp.integrators.cvodes import Cvodes, Multistep
from ocp.integrators.fixed_step import FixedStep
from ocp.integrators.gragg_bulirsch_stoer import Extrapolation
from ocp.integrators.runge_kutta import RadauWithEstimate, RungeKutta
from ocp.integrators.symplectic import StoermerVerlet
from ocp.integrators.tableaux import DORMAND_PRINCE_5, DORMAND_PRINCE_8
from ocp.integrators.trapezoid import PredictorCorrector


def extrapolation(rtol: float = 1e-12, atol: float | Array = 1e-12) -> Extrapolation:
    """Return Gragg-Bulirsch-Stoer extrapolation of order 16, for tolerances near rounding; Radau IIA where it is stiff.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return Extrapolation(rtol, atol)


def dormand_prince_5(rtol: float = 1e-6, atol: float | Array = 1e-6) -> AdaptiveStep:
    """Return the explicit pair of Dormand and Prince of orders 5(4), for loose tolerances.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return AdaptiveStep(RungeKutta(DORMAND_PRINCE_5), rtol, atol)


def dormand_prince_8(rtol: float = 1e-9, atol: float | Array = 1e-9) -> AdaptiveStep:
    """Return the explicit method of Dormand and Prince of orders 8(5,3), for medium to tight tolerances.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return AdaptiveStep(RungeKutta(DORMAND_PRINCE_8), rtol, atol)


def radau_5(rtol: float = 1e-6, atol: float | Array = 1e-6) -> AdaptiveStep:
    """Return Radau IIA of order 5 with error control: stiff systems, oscillating ones included.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return AdaptiveStep(RadauWithEstimate(), rtol, atol)


def adams(rtol: float = 1e-9, atol: float | Array = 1e-9) -> Cvodes:
    """Return the Adams-Moulton formulae of orders 1 to 12 of CVODES, for smooth controls.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return Cvodes(Multistep.ADAMS, rtol, atol)


def bdf(rtol: float = 1e-6, atol: float | Array = 1e-6) -> Cvodes:
    """Return the backward differentiation formulae of orders 1 to 5 of CVODES, for stiff systems that do not oscillate.

    Args:
        rtol, atol: tolerance of one step; atol scalar or (nx,).
    """
    return Cvodes(Multistep.BDF, rtol, atol)


def euler(step: float) -> FixedStep:
    """Return the explicit Euler method, order 1.

    Args:
        step: [s].
    """
    return FixedStep(RungeKutta(tableaux.EULER), step)


def heun(step: float) -> FixedStep:
    """Return Heun's method, order 2: the trapezoid rule with one correction of Euler's prediction.

    Args:
        step: [s].
    """
    return FixedStep(RungeKutta(tableaux.HEUN), step)


def runge_kutta_4(step: float) -> FixedStep:
    """Return the classical Runge-Kutta method, order 4.

    Args:
        step: [s].
    """
    return FixedStep(RungeKutta(tableaux.KUTTA), step)


def predictor_corrector(step: float, corrections: int = 2) -> FixedStep:
    """Return the trapezoid rule as predictor and corrector, order 2; see `PredictorCorrector`.

    Args:
        step: [s].
        corrections: how often the corrector is applied, >= 1.
    """
    return FixedStep(PredictorCorrector(corrections), step)


def gauss(stages: int, step: float) -> FixedStep:
    """Return the Gauss method, order 2 stages, symplectic in canonical coordinates (`ocp.integrators.symplectic`).

    Args:
        stages: 1 (the implicit midpoint rule) to 12.
        step: [s].
    """
    return FixedStep(RungeKutta(tableaux.gauss(stages)), step)


def radau_iia(stages: int, step: float) -> FixedStep:
    """Return the Radau IIA method with steps of one width, order 2 stages - 1, L-stable.

    Args:
        stages: 1 (the implicit Euler method) to 12.
        step: [s].
    """
    return FixedStep(RungeKutta(tableaux.radau_iia(stages)), step)


def stoermer_verlet(step: float) -> FixedStep:
    """Return the Stoermer-Verlet method, order 2: symplectic, for canonical coordinates only.

    Args:
        step: [s].
    """
    return FixedStep(StoermerVerlet(), step)
