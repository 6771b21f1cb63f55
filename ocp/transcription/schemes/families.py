"""The families of collocation schemes of this package by name; a scheme made elsewhere needs no entry."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ocp.transcription.schemes.gauss_legendre import legendre
from ocp.transcription.schemes.lobatto_iiia import lobatto
from ocp.transcription.schemes.radau_iia import radau
from ocp.transcription.schemes.scheme import Control, Scheme

FAMILIES: Mapping[str, Callable[[int, Control], Scheme]] = {"radau": radau, "legendre": legendre, "lobatto": lobatto}
