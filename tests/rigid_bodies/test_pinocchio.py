"""Random trees against Pinocchio, where it is installed (extra `bench`)."""

import casadi as ca
import numpy as np
import pytest
from rigid_bodies.tree_engine import random_joints

from models import Kind, tree
from models.effects import Gravity
from models.forms import canonical, lagrange

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: pip install pin")


def model_of(joints, arm):
    """Return the Pinocchio model of the joints, built by its own functions from the data of the user."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array([0.0, 0.0, -9.81]), np.zeros(3))
    index = {"": (0, pin.SE3.Identity())}
    for joint in joints:
        parent, frame = index[joint.parent]
        placement = frame * pin.SE3(joint.turned(), np.array(joint.origin, dtype=float))
        if joint.kind is Kind.FIXED:
            index[joint.name] = (parent, placement)
            number, own = parent, placement
        else:
            axis = np.array(joint.axis, dtype=float) / np.linalg.norm(joint.axis)
            kind = pin.JointModelRevoluteUnaligned if joint.kind is Kind.REVOLUTE else pin.JointModelPrismaticUnaligned
            number, own = model.addJoint(parent, kind(axis), placement, joint.name), pin.SE3.Identity()
            index[joint.name] = (number, own)
        xx, yy, zz, xy, xz, yz = (*joint.link.inertia, 0.0, 0.0, 0.0)[:6]
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if number:
            body = pin.Inertia(float(joint.link.mass), np.array(joint.link.centre, dtype=float), tensor)
            model.appendBodyToJoint(number, body, own)
    # Pinocchio numbers depth first in the order of addition, which is the order of the coordinates here.
    assert [model.names[k + 1] for k in range(model.nv)] == [c.name for c in arm.coordinates]
    for joint in joints:
        if joint.kind is not Kind.FIXED:
            model.armature[model.joints[index[joint.name][0]].idx_v] = joint.gear**2 * joint.rotor
    return model


def check(seed):
    rng = np.random.default_rng([7, seed])
    # Pinocchio has no rotors that turn with the link before.
    joints = [type(joint)(**{**vars(joint), "carried": False}) for joint in random_joints(rng)]
    arm = tree(joints)
    model = model_of(joints, arm)
    data, n = model.createData(), model.nv
    free, momenta = lagrange(arm, [Gravity()]), canonical(arm, [Gravity()])
    rates = [ca.Function("rate", [s.x, s.u], [s.rate]) for s in (free, momenta)]
    q, v, tau = (rng.uniform(-2, 2, n) for _ in range(3))
    a = pin.aba(model, data, q, v, tau).copy()
    weight = pin.rnea(model, data, q, np.zeros(n), np.zeros(n)).copy()
    metric = np.array([pin.rnea(model, data, q, np.zeros(n), unit) - weight for unit in np.eye(n)])
    got = rates[0](np.concatenate([q, v]), tau).full().ravel()[n:]
    digits = max(1.0, np.linalg.cond(metric) * 1e-3)
    assert np.max(np.abs(got - a)) < 1e-11 * digits * max(np.max(np.abs(a)), 1.0), seed
    speed = rates[1](np.concatenate([q, metric @ v]), tau).full().ravel()[:n]
    assert np.max(np.abs(speed - v)) < 1e-11 * digits * max(np.max(np.abs(v)), 1.0), seed


def test_random_trees_move_as_in_pinocchio():
    for seed in range(10):
        check(seed)


@pytest.mark.slow
def test_more_random_trees_move_as_in_pinocchio():
    for seed in range(10, 100):
        check(seed)
