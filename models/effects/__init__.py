"""Effects such as gravity and friction; each adds its own Terms to a machine. `Terms` is what an effect returns."""

from models.effects.counterbalance import Counterbalance
from models.effects.drive import ElasticDrive, LaggedDrive
from models.effects.drive_limits import PowerLimit, TorqueSpeed
from models.effects.friction import Coulomb, Stribeck, Viscous
from models.effects.gear_efficiency import GearEfficiency
from models.effects.gravity import Gravity
from models.effects.joint_stop import JointStop
from models.effects.motion_limits import MotionLimits, TorqueRate
from models.effects.motor import MotorDrive, WindingHeat
from models.effects.payload import Payload
from models.effects.rotor import RotorInertia
from models.effects.stated_friction import joint_friction as joint_friction
from models.effects.tool_force import ToolForce

# For users who write an effect; __all__ lists the effects themselves.
from models.mechanics.terms import Quantity as Quantity
from models.mechanics.terms import Read as Read
from models.mechanics.terms import State as State
from models.mechanics.terms import Terms as Terms

__all__ = [
    "Coulomb", "Counterbalance", "ElasticDrive", "GearEfficiency", "Gravity", "JointStop", "LaggedDrive",
    "MotionLimits", "MotorDrive", "Payload", "PowerLimit", "RotorInertia", "Stribeck", "ToolForce", "TorqueRate",
    "TorqueSpeed", "Viscous", "WindingHeat",
]  # fmt: skip
