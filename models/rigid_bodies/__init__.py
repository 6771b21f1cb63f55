"""Any serial or tree-like arm from joints and links: recursions instead of a metric in closed form; URDF, DH tables."""

from models.rigid_bodies import robots
from models.rigid_bodies.builders import DhRow, dh, serial, tree
from models.rigid_bodies.clearances import least_clearance
from models.rigid_bodies.collisions import body_capsule, keep_clear, self_pairs, skeleton_shapes, with_shapes
from models.rigid_bodies.joint import Capsule, Joint, Kind, Link
from models.rigid_bodies.tool_poses import along_poses, inverse_kinematics, orientation_error
from models.rigid_bodies.urdf import from_urdf

__all__ = [
    "Capsule", "DhRow", "Joint", "Kind", "Link", "along_poses", "body_capsule", "dh", "from_urdf",
    "inverse_kinematics", "keep_clear", "least_clearance", "orientation_error", "robots", "self_pairs", "serial",
    "skeleton_shapes", "tree", "with_shapes",
]  # fmt: skip
