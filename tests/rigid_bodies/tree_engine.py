"""A second engine for trees of joints: positions of bodies in numpy, derivatives by complex steps, no recursions."""

import numpy as np

from models import Joint, Kind, Link
from models.rigid_bodies.joint import roll_pitch_yaw

STEP = 1e-30


def turn(axis, angle):
    """Return the rotation about a unit axis; the angle may be complex."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Engine:
    """Metric and forces of a tree from the positions of its bodies."""

    def __init__(self, joints, gravity=(0.0, 0.0, -9.81)):
        self.joints, self.gravity = joints, np.array(gravity)
        names = [joint.name for joint in joints]
        self.parents = [names.index(joint.parent) if joint.parent else -1 for joint in joints]
        self.moving = [i for i, joint in enumerate(joints) if joint.kind is not Kind.FIXED]

    def frames(self, q):
        """Return rotation and origin of every link, and the axes of the joints, in the base."""
        coordinates = iter(q)
        frames, axes = [], []
        for joint, parent in zip(self.joints, self.parents, strict=True):
            before, start = (np.eye(3), np.zeros(3)) if parent < 0 else frames[parent]
            given = np.asarray(joint.rotation, dtype=float)
            own = roll_pitch_yaw(given) if given.ndim == 1 else given
            rotation, origin = before @ own, start + before @ np.array(joint.origin)
            axis = np.array(joint.axis, dtype=float) / np.linalg.norm(joint.axis)
            axes.append(rotation @ axis)
            if joint.kind is Kind.REVOLUTE:
                rotation = rotation @ turn(axis, next(coordinates))
            elif joint.kind is Kind.PRISMATIC:
                origin = origin + rotation @ axis * next(coordinates)
            frames.append((rotation, origin))
        return frames, axes

    def metric(self, q):
        """Return M(q) of bodies and rotors; q may be complex."""
        frames, axes = self.frames(q)
        n = len(self.moving)
        total = np.zeros((n, n), dtype=complex)
        spins = np.zeros((len(self.joints), 3, n), dtype=complex)  # omega = J v of every link
        for i, (joint, (rotation, origin)) in enumerate(zip(self.joints, frames, strict=True)):
            parent = self.parents[i]
            if parent >= 0:
                spins[i] = spins[parent]
            if joint.kind is Kind.REVOLUTE:
                spins[i, :, self.moving.index(i)] += axes[i]
            if joint.kind is not Kind.FIXED:
                k = self.moving.index(i)
                total[k, k] += joint.gear**2 * joint.rotor
                if joint.carried and parent >= 0:
                    coupling = joint.gear * joint.rotor * axes[i] @ spins[parent]
                    total[k, :] += coupling
                    total[:, k] += coupling
            centre = origin + rotation @ np.array(joint.link.centre)
            slope = np.zeros((3, n), dtype=complex)
            path, at = [], i
            while at >= 0:
                path.append(at)
                at = self.parents[at]
            for a in path:
                if self.joints[a].kind is Kind.REVOLUTE:
                    slope[:, self.moving.index(a)] = np.cross(axes[a], centre - frames[a][1])
                elif self.joints[a].kind is Kind.PRISMATIC:
                    slope[:, self.moving.index(a)] = axes[a]
            xx, yy, zz, xy, xz, yz = (*joint.link.inertia, 0.0, 0.0, 0.0)[:6]
            tensor = rotation @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ rotation.T
            total += joint.link.mass * slope.T @ slope + spins[i].T @ tensor @ spins[i]
        return total

    def potential(self, q):
        """Return the potential energy of the weight."""
        frames, _ = self.frames(q)
        return -sum(
            joint.link.mass * self.gravity @ (origin + rotation @ np.array(joint.link.centre))
            for joint, (rotation, origin) in zip(self.joints, frames, strict=True)
        )

    def slopes(self, q):
        """Return dM/dq_i and dU/dq_i, exact to rounding."""
        q = np.array(q, dtype=float)
        unit = np.eye(len(q)) * 1j * STEP
        return (
            np.array([self.metric(q + step).imag / STEP for step in unit]),
            np.array([self.potential(q + step).imag / STEP for step in unit]),
        )

    def accelerations(self, q, v, tau):
        """Return a of M a + (dM/dt) v - dT/dq + dU/dq = tau, and the size of its terms."""
        metric, (changes, weight) = self.metric(q).real, self.slopes(q)
        moved = np.einsum("kij,k,j->i", changes, v, v) - np.einsum("kij,i,j->k", changes, v, v) / 2
        return np.linalg.solve(metric, tau - moved - weight)


def random_joints(rng, count=None):
    """Return joints of a random tree: both kinds, branches, fixed ones, rotors, special and general placements."""
    n = int(rng.integers(1, 9)) if count is None else count
    joints = []
    for i in range(n):
        parent = "" if not joints else joints[int(rng.integers(max(0, len(joints) - 2), len(joints)))].name
        special = rng.uniform() < 0.4
        quarter = rng.choice([0.0, np.pi / 2, -np.pi / 2, np.pi], 3)
        axis = np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0]) if special else rng.normal(size=3)
        origin = (
            np.where(rng.uniform(size=3) < 0.5, 0.0, rng.uniform(-0.6, 0.6, 3))
            if special
            else rng.uniform(-0.6, 0.6, 3)
        )
        moments = rng.uniform(0.05, 0.6, 3)
        principal = np.diag([moments[1] + moments[2], moments[0] + moments[2], moments[0] + moments[1]])
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        tensor = axes @ principal @ axes.T
        inertia = tuple(tensor[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        link = Link(rng.uniform(0.5, 10.0), tuple(rng.uniform(-0.3, 0.3, 3)), inertia)
        kind = Kind.REVOLUTE if rng.uniform() < 0.7 else Kind.PRISMATIC
        rotor = rng.uniform() < 0.3
        joints.append(
            Joint(
                f"j{i}",
                kind,
                parent,
                tuple(origin),
                tuple(quarter if special else rng.uniform(-3, 3, 3)),
                tuple(axis),
                link,
                rotor=1e-4 * rng.uniform(0.5, 5) if rotor else 0.0,
                gear=rng.uniform(-120, 120) if rotor else 1.0,
                carried=bool(rotor and rng.uniform() < 0.5),
            )
        )
        if rng.uniform() < 0.2:
            last = joints[-1].name
            joints.append(
                Joint(f"f{i}", Kind.FIXED, last, tuple(rng.uniform(-0.3, 0.3, 3)), (0.1, 0.2, 0.3), link=link)
            )
    return joints
