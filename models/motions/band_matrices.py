"""Symmetric positive definite band matrices, many at once: factors, solutions, determinant, band of the inverse."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ocp.checks import Array

BLOCK = 16  # rows of one block; at least the half bandwidth


def multiply(band: Array, x: Array) -> Array:
    """Return A x of a symmetric band matrix, shape of x.

    Args:
        band: (K, h + 1) lower band, band[i, d] = A_i,i-d.
        x: (K, ...).
    """
    result: Array = band[:, 0].reshape(-1, *[1] * (x.ndim - 1)) * x
    for d in range(1, band.shape[1]):
        entries = band[d:, d].reshape(-1, *[1] * (x.ndim - 1))
        result[d:] += entries * x[:-d]
        result[:-d] += entries * x[d:]
    return result


@dataclass(frozen=True, eq=False)
class Factors:
    """Block factors A = L D L' of m band matrices, L with unit blocks on its diagonal."""

    size: int  # K
    half: int  # h
    pivots: Array  # (N, m, b, b) inverses of the blocks of D
    multipliers: Array  # (N - 1, m, b, b) blocks of L below the diagonal
    log_determinant: Array  # (m,)

    def solve(self, right: Array) -> Array:
        """Return A^-1 right, right of shape (m, K)."""
        blocks, m, b, _ = self.pivots.shape
        padded = np.zeros((m, blocks * b))
        padded[:, : self.size] = right
        x = padded.reshape(m, blocks, b).transpose(1, 0, 2)[..., None].copy()
        for k in range(1, blocks):
            x[k] -= self.multipliers[k - 1] @ x[k - 1]
        x = self.pivots @ x
        for k in range(blocks - 2, -1, -1):
            x[k] -= self.multipliers[k].swapaxes(1, 2) @ x[k + 1]
        return x[..., 0].transpose(1, 0, 2).reshape(m, -1)[:, : self.size]

    def inverse_band(self) -> Array:
        """Return the lower band (m, K, h + 1) of A^-1, without forming the rest.

        Source: K. Takahashi, J. Fagan, M. Chin, Formation of a sparse bus impedance matrix (1973), by blocks.
        """
        blocks, m, b, _ = self.pivots.shape
        # Two block rows at a time hold every entry within the band, as h <= b.
        result = np.zeros((m, blocks * b, self.half + 1))
        diagonal = self.pivots[-1]
        i = np.arange(b)
        for k in range(blocks - 1, -1, -1):
            if k < blocks - 1:
                below = -diagonal @ self.multipliers[k]  # rows of block k + 1, columns of block k
                for d in range(1, self.half + 1):
                    rows = i[:d]
                    result[:, (k + 1) * b + rows, d] = below[:, rows, b + rows - d]
                diagonal = self.pivots[k] - self.multipliers[k].swapaxes(1, 2) @ below
            for d in range(self.half + 1):
                rows = i[d:]
                result[:, k * b + rows, d] = diagonal[:, rows, rows - d]
        return result[:, : self.size]


def factorise(band: Array, added: Array, weights: Array) -> Factors:
    """Factorise A_j = band + weights_j * added for all j at once.

    Args:
        band, added: (K, h + 1) lower bands, h <= BLOCK.
        weights: (m,).

    Raises:
        ValueError: a matrix is not positive definite.

    Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4.5 (block tridiagonal systems).
    """
    size, half = band.shape[0], band.shape[1] - 1
    first, second = _blocks(band, 1.0), _blocks(added, 0.0)
    blocks = len(first[0])
    w = weights[:, None, None]
    pivots = np.empty((blocks, len(weights), BLOCK, BLOCK))
    multipliers = np.empty((blocks - 1, len(weights), BLOCK, BLOCK))
    log_determinant = np.zeros(len(weights))
    rest = first[0][0] + w * second[0][0]
    try:
        for k in range(blocks):
            lower = np.linalg.inv(np.linalg.cholesky(rest))
            log_determinant -= 2.0 * np.log(np.einsum("mii->mi", lower)).sum(axis=1)
            pivots[k] = lower.swapaxes(1, 2) @ lower
            if k < blocks - 1:
                coupling = first[1][k] + w * second[1][k]
                multipliers[k] = coupling @ pivots[k]
                rest = first[0][k + 1] + w * second[0][k + 1] - multipliers[k] @ coupling.swapaxes(1, 2)
    except np.linalg.LinAlgError:
        raise ValueError("the band matrix is not positive definite") from None
    return Factors(size, half, pivots, multipliers, log_determinant)


def _blocks(band: Array, padding: float) -> tuple[Array, Array]:
    """Return the blocks (N, b, b) on the diagonal and (N - 1, b, b) below it; `padding` fills up the diagonal."""
    size, half = band.shape[0], band.shape[1] - 1
    blocks = -(-size // BLOCK)
    full = np.zeros((blocks * BLOCK, half + 1))
    full[:size] = band
    full[size:, 0] = padding
    full = full.reshape(blocks, BLOCK, half + 1)
    diagonal, below = np.zeros((blocks, BLOCK, BLOCK)), np.zeros((blocks - 1, BLOCK, BLOCK))
    i = np.arange(BLOCK)
    for d in range(half + 1):
        rows = i[d:]
        diagonal[:, rows, rows - d] = diagonal[:, rows - d, rows] = full[:, rows, d]
        rows = i[:d]
        below[:, rows, BLOCK + rows - d] = full[1:, rows, d]
    return diagonal, below
