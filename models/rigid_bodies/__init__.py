"""Any serial or tree-like arm from joints and links: recursions instead of a metric in closed form; URDF, DH tables."""

from models.rigid_bodies import robots
from models.rigid_bodies.builders import DhRow, dh, serial, tree
from models.rigid_bodies.joint import Capsule, Joint, Kind, Link
from models.rigid_bodies.tool_poses import along_poses, inverse_kinematics, orientation_error
from models.rigid_bodies.urdf import from_urdf

__all__ = [
    "Capsule", "DhRow", "Joint", "Kind", "Link", "along_poses", "dh", "from_urdf", "inverse_kinematics",
    "orientation_error", "robots", "serial", "tree",
]  # fmt: skip
