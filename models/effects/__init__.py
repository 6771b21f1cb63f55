"""Effects: each adds its own Terms to a machine, or is not there at all."""

from models.effects.gravity import Gravity
from models.effects.payload import Payload

__all__ = ["Gravity", "Payload"]
