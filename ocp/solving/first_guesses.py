"""Initial guesses made from the problem alone: a straight line, a smooth motion, random variations of it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Several
from dataclasses import replace

import casadi as ca
import numpy as np

from ocp.checks import Array
from ocp.numerics.evaluation import evaluate
from ocp.numerics.rate_functions import slopes
from ocp.problem.boundary_states import ends
from ocp.problem.constraints import Where, start
from ocp.problem.pointwise import components_along, point_values
from ocp.problem.problem import Fixed, Free, Problem, parameters
from ocp.problem.sequence import Sequence
from ocp.solving.guess_completion import of_main_states
from ocp.solving.path_following import SMOOTH_POINTS, balance, follow, layers_of, quintic
from ocp.transcription.guess import Guess

POINTS = 11  # points of a straight line
STRETCHES = 16  # how often the duration is lengthened at most, until the controls satisfy their bounds
FIRST_STRETCH, LEAST_STRETCH, LONGEST = 0.25, 1.25, 1e20  # first duration and smallest factor of one lengthening
SHORTER, SHORTENINGS = 1.0 / 16.0, 16  # factor and number of shortenings, as long as all limits are satisfied
NEGLIGIBLE = 1e-9  # share of the largest rate that is rounding
MENDED = 1e-3  # share of the rate that the controls can cause directly: a smaller miss is mended by them
ROUGH = 0.2  # share of its largest rate by which a state of a guess may miss the equations of motion


@of_main_states
def straight_line(problem: Problem, values: Several[float]) -> Guess:
    """Return the straight line from a state that meets the start conditions to one that meets the end conditions.

    The states at the ends are the ones nearest to zero (within the limits along the motion) that satisfy
    start(...) and end(...), by Gauss-Newton; states without a condition are constant. The controls minimise
    |x' - f(x, u)| at each point of the line, within their bounds.

    Args:
        problem: the problem.
        values: of the parameters.
    """
    p = parameters(problem, values)
    duration = _duration(problem)
    first, last, _ = ends(problem, p)
    share = np.linspace(0.0, 1.0, POINTS)
    x = first + share[:, None] * (last - first)
    rates, (low, high) = np.tile((last - first) / duration, (POINTS, 1)), problem.limits(Where.ALONG, problem.system.u)
    f, _, by_u = evaluate(slopes(problem.system), x, np.clip(np.zeros(len(low)), low, high), p)
    u = np.clip(balance(problem, rates, f, by_u), low, high)
    return Guess(share, x, u, duration, np.zeros(0))


@of_main_states
def smooth(problem: Problem, values: Several[float]) -> Guess:
    """Return a smooth motion between the ends whose states and controls follow from the system itself.

    The states that are the most integrations away from the controls (usually positions) follow a quintic, or a septic
    for more than two integrations; the other states and the controls follow from x' = f(x, u) at each point. A free
    duration is lengthened from a quarter of the guessed one until the controls satisfy their bounds (where no control
    has any, until all limits along the motion are satisfied); if that is far too long, it is shortened first as long
    as all limits are satisfied.

    Args:
        problem: the problem.
        values: of the parameters.
    """
    p = parameters(problem, values)
    first, last, _ = ends(problem, p)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    layers = layers_of(problem)
    duration = _duration(problem) * (FIRST_STRETCH if isinstance(problem.horizon, Free) else 1.0)
    best: Guess | None = None
    longest = min(LONGEST, problem.horizon.upper) if isinstance(problem.horizon, Free) else LONGEST
    least, path, tried = np.inf, quintic(first, last, len(layers)), dict[float, Guess]()
    use = _use_of(problem, p)
    if isinstance(problem.horizon, Free) and problem.minimise.time > 0.0 and np.isfinite(high - low).any():
        kept = _keeping(problem, p)
        for count in range(SHORTENINGS if np.any(first != last) else 0):
            trial = follow(problem, path, duration, layers, p)
            tried[duration] = trial
            if not (kept(trial) and _is_motion(problem, trial, p)):
                # The loop below lengthens the motion by the factor that the controls need.
                duration *= 1.0 / SHORTER if count and use(trial) <= 1.0 else 1.0
                break
            if SHORTER * duration < problem.horizon.lower:
                break
            duration *= SHORTER
    for _ in range(STRETCHES if isinstance(problem.horizon, Free) else 1):
        guess = tried.get(duration) or follow(problem, path, duration, layers, p)
        used = use(guess)
        if used < least:
            best, least = guess, used
        if used <= 1.0:
            break
        # Accelerations fall with the square of the duration.
        duration = min(duration * float(np.clip(np.sqrt(used), LEAST_STRETCH, 1e8)), longest)
    if best is None:
        return straight_line(problem, values)
    return Guess(best.share, best.x, np.clip(best.u, low, np.maximum(low, high)), best.duration, best.free)


@of_main_states
def scattered(problem: Problem, values: Several[float], random: np.random.Generator) -> Guess:
    """Return a smooth motion between the ends with random detours, for a search of other local optima.

    The states that are the most integrations away from the controls are displaced by a bump of random height, at most
    the distance of their limits (without limits: their range plus a radian, or plus the largest range of others with
    the same unit), and clipped to these limits; the duration is multiplied by a random factor, log-normal with a
    standard deviation of 0.4.

    Args:
        problem: the problem.
        values: of the parameters.
        random: generator.
    """
    p = parameters(problem, values)
    first, last, _ = ends(problem, p)
    layers = layers_of(problem)
    path = quintic(first, last, len(layers))
    low, high = problem.limits(Where.ALONG, problem.system.x)
    share = np.linspace(0.0, 1.0, SMOOTH_POINTS)
    for i in layers[-1] if layers else []:
        height = high[i] - low[i] if np.isfinite(high[i] - low[i]) else _room(problem, path, i)
        bump = np.zeros(SMOOTH_POINTS)
        for order in (2, 4):  # one or two humps, with value and slope zero at both ends
            bump += random.uniform(-0.5, 0.5) * np.sin(np.pi * share) ** 2 * np.cos((order - 2) * np.pi * share / 2.0)
        path[:, i] = np.clip(path[:, i] + height * bump, low[i], high[i])
    factor = np.exp(random.normal(0.0, 0.4)) if isinstance(problem.horizon, Free) else 1.0
    duration = smooth(problem, values).duration * float(factor)
    guess = follow(problem, path, duration, layers, p)
    controls = problem.limits(Where.ALONG, problem.system.u)
    u = np.clip(np.nan_to_num(guess.u), controls[0], np.maximum(*controls))
    return Guess(guess.share, np.nan_to_num(guess.x), u, duration, guess.free)


def _is_motion(problem: Problem, guess: Guess, p: Array) -> bool:
    """Return whether a guess satisfies the equations of motion roughly: the controls can cause its rates.

    A state may miss its rate by ROUGH of its largest one. Rounding of the state does not count, nor a miss of
    less than MENDED of what the controls can cause directly.

    Args:
        problem: one phase.
        guess: at SMOOTH_POINTS times.
        p: (np,) values of the parameters.
    """
    f, _, by_u = evaluate(slopes(problem.system), guess.x, guess.u, p)
    low, high = problem.limits(Where.ALONG, problem.system.u)
    largest = np.max(np.abs([np.where(np.isfinite(side), side, 0.0) for side in (low, high)]), axis=0, initial=0.0)
    most = np.maximum(largest, np.max(np.abs(guess.u), axis=0))
    effect = np.abs(by_u.reshape(len(guess.share), len(low), -1)) * most[:, None]
    steps = guess.duration * np.diff(guess.share)
    moved = np.diff(guess.x, axis=0) / steps[:, None]
    missed = np.max(np.abs(moved - (f[:-1] + f[1:]) / 2.0), axis=0)
    rounding = 8.0 * np.finfo(float).eps * np.max(np.abs(guess.x), axis=0) / np.min(steps)
    allowed = ROUGH * np.max(np.abs(moved), axis=0) + NEGLIGIBLE * np.max(np.abs(moved), initial=0.0)
    return bool(np.all(missed <= allowed + rounding + MENDED * np.max(effect.sum(axis=1), axis=0)))


def _keeping(problem: Problem, p: Array) -> Callable[[Guess], bool]:
    """Return the function that checks whether a guess satisfies all limits along the motion."""
    along = components_along(problem)
    low, high = (np.concatenate([getattr(c, side) for c in problem.subject_to])[along] for side in ("lower", "upper"))

    def kept(guess: Guess) -> bool:
        values = evaluate(point_values(problem), guess.x, guess.u, p)[1][:, along]
        return bool(np.all((values >= low) & (values <= high)))

    return kept


def _room(problem: Problem, path: Array, state: int) -> float:
    """Return how far a state without limits may stray: a radian, or as far as others of its unit move."""
    units = [label.unit for label in problem.system.label("x", path.shape[1])]
    same = [float(np.ptp(path[:, i])) for i, unit in enumerate(units) if unit == units[state]]
    own = float(np.ptp(path[:, state]))
    return own + (1.0 if units[state] in ("rad", "") else max(same))


def _use_of(problem: Problem, p: Array) -> Callable[[Guess], float]:
    """Return the function that finds how far a guess uses the limits of the controls, of everything if they have none.

    Accelerations as controls have no bounds: expressions of them do, and their integrals.
    """
    low, high = problem.limits(Where.ALONG, problem.system.u)
    if np.isfinite(low).any() or np.isfinite(high).any() or not len(low) or not len(problem.subject_to):
        return lambda guess: _use(guess.u, low, high)
    along = components_along(problem)
    least, most = (np.concatenate([getattr(c, side) for c in problem.subject_to])[along] for side in ("lower", "upper"))
    return lambda guess: _use(evaluate(point_values(problem), guess.x, guess.u, p)[1][:, along], least, most)


def _use(u: Array, low: Array, high: Array) -> float:
    """Return the largest share of its range that a column uses, 1 for one at its limit."""
    both = np.isfinite(low) & np.isfinite(high) & (high > low)
    if not both.any() or not np.all(np.isfinite(u)):
        return 0.0 if np.all(np.isfinite(u)) else np.inf
    middle, half = (low[both] + high[both]) / 2.0, (high[both] - low[both]) / 2.0
    return float(np.max(np.abs(u[:, both] - middle) / half))


def _duration(problem: Problem) -> float:
    horizon = problem.horizon
    if isinstance(horizon, Fixed):
        return horizon.duration
    return float(np.clip(horizon.guess, horizon.lower, horizon.upper))


def phase_guesses(
    problem: Problem | Sequence, values: list[list[float]], make: Callable[[Problem, Several[float]], Guess]
) -> list[Guess]:
    """Return one guess for each phase, each beginning where the one before it ends.

    Args:
        problem: a Problem, or a Sequence whose links say what is continuous.
        values: of the parameters of each phase.
        make: straight_line or smooth.
    """
    if isinstance(problem, Problem):
        return [make(problem, values[0])]
    guesses = [make(problem.problems[0], values[0])]
    for k, phase in enumerate(problem.problems[1:]):
        before, after = problem.sides[k]
        old = problem.problems[k].system
        reached = ca.Function("reached", [old.x, old.p], [ca.densify(before)])(guesses[-1].x[-1], values[k])
        there = replace(phase, subject_to=(*phase.subject_to, start(after, np.array(reached).ravel())))
        guesses.append(make(there, values[k + 1]))
    return guesses
