"""Smoothing splines of noisy samples: strength from the noise, uncertainty of position, velocity, acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.motions.b_splines import as_piecewise, basis_rows
from models.motions.band_matrices import factorise, multiply
from models.motions.piecewise import Piecewise
from models.torques.time_means import rms_of_samples
from ocp.checks import Array
from ocp.system import Label

DEGREE = 5
PENALISED = 3  # order of the derivative whose square is penalised: the jerk
FEWEST = 8  # samples
COARSEST = 64  # samples for one knot to begin with
CLOSE = 2.0  # knots are refined to this multiple of the length over which the spline averages
TRIALS = 9  # strengths compared at once
# Strengths are searched over these decades, relative to the ratio of the two matrices.
DECADES = (-8.0, 11.0)
NEIGHBOURHOOD = (-4.0, 0.8)  # decades, once coarser knots have given a first fit
ENOUGH = 0.1  # decades; the likelihood is flat around its maximum
ALL = 0.99  # share of the samples; a fit with more degrees of freedom has no noise left
# The residual of a fit never counts as smaller than this share of the range of the samples.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class Smoothed:
    """A quintic smoothing spline s(t) of samples y_i = s(t_i) + noise, and what it leaves open.

    The spline minimises sum (y_i - s(t_i))^2 + lambda integral s'''(t)^2 dt. With the noise level sigma the
    coefficients have the covariance sigma^2 (N'N + lambda Omega)^-1.
    """

    curve: Piecewise
    noise: Array  # (n,) standard deviation of the noise, given or estimated [rad or m]
    residual: Array  # (n,) root mean square of y - s(t) [rad or m]
    strength: Array  # (n,) lambda [s^5]
    freedom: Array  # (n,) effective degrees of freedom of the fit, trace of the hat matrix
    knots: Array  # of the B-splines, in units of `unit` since the first sample
    unit: float  # [s]
    inverse: Array  # (n, K, 6) band of (N'N + lambda Omega)^-1
    samples: int

    def covariance(self, t: Array) -> Array:
        """Return the covariance (len(t), n, 3, 3) of position, velocity and acceleration at times t [s].

        Source: G. Wahba, Bayesian "confidence intervals" for the cross-validated smoothing spline (1983).
        """
        s = (t - self.curve.breaks[0]) / self.unit
        parts = [basis_rows(self.knots, DEGREE, s, order) for order in range(3)]
        columns = parts[0][0]
        rows = np.stack([values / self.unit**order for order, (_, values) in enumerate(parts)], axis=1)
        i, j = np.meshgrid(np.arange(DEGREE + 1), np.arange(DEGREE + 1), indexing="ij")
        higher, apart = np.maximum(i, j), np.abs(i - j)
        local = self.inverse[:, columns[:, higher], apart]  # (n, K, 6, 6)
        result = np.einsum("kai,nkij,kbj->knab", rows, local, rows, optimize=True)
        return np.asarray(result * self.noise[:, None, None] ** 2)

    def notes(self, labels: tuple[Label, ...]) -> list[str]:
        """Say which coordinates have a noise that cannot be distinguished from the motion."""
        return [
            f"{label.name}: the spline follows every sample, so that its noise cannot be distinguished from the "
            "motion; give it"
            for label, free in zip(labels, self.freedom, strict=True)
            if free > ALL * self.samples
        ]


def smooth(t: Array, y: Array, noise: Array | None) -> Smoothed:
    """Fit a quintic smoothing spline whose strength follows the noise level, for every coordinate on its own.

    lambda maximises the restricted likelihood of the samples, for the given sigma or with sigma as a further unknown.
    Knots are refined until they are closer than the length (lambda dt)^(1/6) over which the spline averages.

    Args:
        t: (K,) increasing times [s].
        y: (K, n) samples [rad or m].
        noise: (n,) standard deviations > 0 [rad or m], None = estimated.

    Raises:
        ValueError: fewer than 8 samples, or numbers beyond double precision.

    Source: G. Wahba, Spline Models for Observational Data (1990), 1.3 and 4; restricted likelihood: S. N. Wood, Fast
        stable restricted maximum likelihood estimation, J. R. Stat. Soc. B 73 (2011); reduced knots: F. O'Sullivan,
        A statistical perspective on ill-posed inverse problems (1986).
    """
    if len(t) < FEWEST:
        raise ValueError(f"{len(t)} samples, a smoothing spline needs at least {FEWEST}; give waypoints instead")
    step = (t[-1] - t[0]) / (len(t) - 1)
    spacing = min(COARSEST, max(1, len(t) // 16))
    strength = None
    while True:
        with np.errstate(all="ignore"):  # what overflows is refused
            fit = _Fit.of(t, y, spacing)
            strength = fit.choose(noise, strength)
        length = float(np.min((strength * step) ** (1.0 / 6.0)))
        if spacing == 1 or spacing * step <= CLOSE * length:
            return fit.result(strength, noise)
        spacing = max(1, min(spacing // 2, int(CLOSE * length / step)))


@dataclass(frozen=True, eq=False)
class _Fit:
    """The linear algebra of one choice of knots: N'N, Omega and the least-squares fit to start from."""

    t: Array
    y: Array
    knots: Array
    unit: float
    rows: tuple[Array, Array]
    normal: Array  # (K, 6) band of N'N
    jerks: tuple[Array, Array]  # rows D of weighted jerks at Gauss points, Omega = D'D
    penalty: Array  # (K, 6) band of Omega, in the unit of time
    ratio: float  # of the two
    first: Array  # (K, n) coefficients of a fit that hardly smooths
    left: Array  # (n,) sum of its squared residuals
    gradient: Array  # (K, n) N' residuals

    @classmethod
    def of(cls, t: Array, y: Array, spacing: int) -> _Fit:
        inner = t[spacing:-1:spacing] if spacing < len(t) - 1 else t[:0]
        if len(inner) and len(t) - 1 - spacing * len(inner) < spacing / 2:
            inner = inner[:-1]
        unit = (t[-1] - t[0]) / (len(inner) + 1)
        ends = np.array([0.0, (t[-1] - t[0]) / unit])
        knots = np.concatenate([np.repeat(ends[0], DEGREE + 1), (inner - t[0]) / unit, np.repeat(ends[1], DEGREE + 1)])
        size = len(knots) - DEGREE - 1
        rows = basis_rows(knots, DEGREE, (t - t[0]) / unit, 0)
        normal = _gram(rows, size)
        nodes, weights = np.polynomial.legendre.leggauss(DEGREE - PENALISED + 1)
        breaks = np.unique(knots)
        widths = np.diff(breaks)
        points = (breaks[:-1, None] + widths[:, None] * (nodes + 1.0) / 2.0).ravel()
        columns, values = basis_rows(knots, DEGREE, points, PENALISED)
        jerks = columns, values * np.sqrt((widths[:, None] * weights / 2.0).ravel())[:, None]
        penalty = _gram(jerks, size)
        ratio = float(normal[:, 0].sum() / penalty[:, 0].sum())
        smallest = np.array([ratio * 10.0 ** DECADES[0]])
        moved = _moments(rows, y, size)
        start = factorise(normal, penalty, smallest)
        first = np.stack([start.solve(column[None])[0] for column in moved.T], axis=1)
        residual = y - _values(rows, first)
        left = np.einsum("kn,kn->n", residual, residual)
        return cls(t, y, knots, unit, rows, normal, jerks, penalty, ratio, first, left, _moments(rows, residual, size))

    def choose(self, noise: Array | None, near: Array | None) -> Array:
        """Return lambda (n,) [s^5] of the largest restricted likelihood, in the neighbourhood of an earlier one."""
        n = self.y.shape[1]
        if near is None:
            low, high = np.full(n, DECADES[0]), np.full(n, DECADES[1])
        else:
            middle = np.log10(near / self.unit**5 / self.ratio)
            low, high = (np.clip(middle + shift, *DECADES) for shift in NEIGHBOURHOOD)
        best = np.zeros(n)
        while True:
            decades = np.linspace(low, high, TRIALS, axis=1)  # (n, trials)
            score = self._score(self.ratio * 10.0**decades, noise)
            if not np.all(np.isfinite(score)):
                i = int(np.argmax(~np.all(np.isfinite(score), axis=1)))
                length, largest = self.t[-1] - self.t[0], np.max(np.abs(self.y[:, i]))
                raise ValueError(
                    f"coordinate {i + 1}: samples up to {largest:.3g} over {length:.3g} s, or their noise, are beyond "
                    "double precision for a smoothing spline; give them in other units, or velocities too"
                )
            index = np.argmin(score, axis=1)
            best = decades[np.arange(n), index]
            width = (high - low) / (TRIALS - 1)
            below = (index == 0) & (low > DECADES[0])
            above = (index == TRIALS - 1) & (high < DECADES[1])
            low = np.clip(np.where(below, low + NEIGHBOURHOOD[0], np.where(above, high, best) - width), *DECADES)
            high = np.clip(np.where(above, high - NEIGHBOURHOOD[0], best + width), *DECADES)
            if np.max(width) < ENOUGH and not np.any(below | above):
                break
        return np.asarray(self.ratio * 10.0**best * self.unit**5)

    def _score(self, strengths: Array, noise: Array | None) -> Array:
        """Return minus twice the restricted log likelihood (n, trials), up to a constant."""
        n, trials = strengths.shape
        flat = strengths.ravel()
        factors = factorise(self.normal, self.penalty, flat)
        bent = self._bent().T
        right = np.repeat(self.gradient.T, trials, axis=0) - flat[:, None] * np.repeat(bent, trials, axis=0)
        delta = factors.solve(right).T  # (K, n trials)
        gradient, first = np.repeat(self.gradient, trials, axis=1), np.repeat(self.first, trials, axis=1)
        squares = np.repeat(self.left, trials) + np.sum(delta * (multiply(self.normal, delta) - 2.0 * gradient), axis=0)
        # As a sum of squares: the quadratic form of Omega would cancel where the spline is smooth.
        squares = squares + flat * np.sum(_values(self.jerks, first + delta) ** 2, axis=0)
        # The sum grows with lambda; where rounding says otherwise, a larger lambda is no better than a smaller one.
        squares = np.maximum(squares, np.repeat(self._floor(), trials) * len(self.t)).reshape(n, trials)
        squares = np.maximum.accumulate(squares, axis=1)
        rest = len(self.t) - PENALISED
        fit = rest * np.log(squares) if noise is None else squares / noise[:, None] ** 2
        rank = len(self.knots) - DEGREE - 1 - PENALISED
        return np.asarray(fit + factors.log_determinant.reshape(n, trials) - rank * np.log(strengths))

    def _bent(self) -> Array:
        """Return Omega times the first coefficients, (K, n)."""
        return _moments(self.jerks, _values(self.jerks, self.first), len(self.first))

    def _floor(self) -> Array:
        return np.asarray((ROUNDING * np.max(np.abs(self.y), axis=0)) ** 2 + np.finfo(float).tiny)

    def result(self, strength: Array, noise: Array | None) -> Smoothed:
        """Return the spline of the chosen strengths (n,) [s^5]."""
        scaled = strength / self.unit**5
        factors = factorise(self.normal, self.penalty, scaled)
        bent = self._bent()
        coefficients = self.first + factors.solve((self.gradient - scaled * bent).T).T
        residual = self.y - _values(self.rows, coefficients)
        squares = np.einsum("kn,kn->n", residual, residual)
        inverse = factors.inverse_band()
        twice = np.where(np.arange(DEGREE + 1) == 0, 1.0, 2.0)
        freedom = np.einsum("nkd,kd,d->n", inverse, self.normal, twice)
        if noise is None:
            bending = scaled * np.sum(_values(self.jerks, coefficients) ** 2, axis=0)
            noise = np.sqrt((squares + bending) / (len(self.t) - PENALISED))
        spline = as_piecewise(self.knots, DEGREE, coefficients)
        powers = self.unit ** np.arange(DEGREE + 1)
        curve = Piecewise(self.t[0] + spline.breaks * self.unit, spline.coefficients / powers[:, None])
        size = rms_of_samples(self.t, residual)
        return Smoothed(curve, noise, size, strength, freedom, self.knots, self.unit, inverse, len(self.t))


def _values(rows: tuple[Array, Array], coefficients: Array) -> Array:
    """Return the rows times coefficients (K, n)."""
    columns, values = rows
    total: Array = values[:, 0, None] * coefficients[columns[:, 0]]
    for i in range(1, values.shape[1]):
        total += values[:, i, None] * coefficients[columns[:, i]]
    return total


def _gram(rows: tuple[Array, Array], size: int) -> Array:
    """Return the lower band (size, d + 1) of the matrix of inner products of the columns."""
    columns, values = rows
    band = np.zeros((size, values.shape[1]))
    for i in range(values.shape[1]):
        for j in range(i + 1):
            band[:, i - j] += np.bincount(columns[:, i], values[:, i] * values[:, j], size)
    return band


def _moments(rows: tuple[Array, Array], y: Array, size: int) -> Array:
    """Return N' y, shape (size, n)."""
    columns, values = rows
    return np.stack(
        [
            sum(np.bincount(columns[:, i], values[:, i] * y[:, c], size) for i in range(values.shape[1]))
            for c in range(y.shape[1])
        ],
        axis=1,
    )
