"""Every effect with parameters of a usual size, for the tests: as a list, since some need others beside them."""

import casadi as ca

from models.effects import (
    Coulomb,
    Counterbalance,
    ElasticDrive,
    GearEfficiency,
    Gravity,
    JointStop,
    LaggedDrive,
    MotionLimits,
    MotorDrive,
    Payload,
    PowerLimit,
    RotorInertia,
    Stribeck,
    ToolForce,
    TorqueRate,
    TorqueSpeed,
    Viscous,
    WindingHeat,
)

G = 9.81
TENSOR = (0.05, 0.04, 0.03, 0.004, -0.003, 0.002)


def each(n, first, step):
    """Return n different numbers, so that no drive is mistaken for another."""
    return tuple(first + step * i for i in range(n))


def swing(t):
    return ca.vertcat(30.0 * ca.sin(5.0 * t), 10.0, -20.0 * ca.cos(3.0 * t))


def stiff(position, velocity):
    return -200.0 * position - 5.0 * velocity


CASES = {
    "gravity": lambda n: [Gravity(G)],
    "gravity_aslant": lambda n: [Gravity(G, (0.3, -0.5, -0.8))],
    "payload": lambda n: [Payload(5.0)],
    "payload_offset": lambda n: [Payload(5.0, (0.03, -0.05, 0.1)), Gravity(G)],
    "payload_rigid": lambda n: [Payload(5.0, (0.03, -0.05, 0.1), TENSOR), Gravity(G)],
    "viscous": lambda n: [Viscous(each(n, 0.5, 0.2))],
    "coulomb": lambda n: [Coulomb(each(n, 2.0, 0.5), 0.3)],
    "stribeck": lambda n: [Stribeck(each(n, 2.0, 0.5), each(n, 3.0, 0.4), 0.8, 0.2)],
    "rotor_inertia": lambda n: [RotorInertia(1e-4, each(n, 80.0, 20.0))],
    "rotor_coupled": lambda n: [RotorInertia(1e-4, 90.0, [[float(i == j) + 0.2 * (i > j) for j in range(n)]
                                                          for i in range(n)])],
    "lagged_drive": lambda n: [LaggedDrive(each(n, 0.02, 0.01))],
    "elastic_drive": lambda n: [ElasticDrive(each(n, 2e3, 1e3), each(n, 0.5, 0.2), 3.0)],
    "elastic_in_part": lambda n: [ElasticDrive((2e3, *[None] * (n - 1)), 0.7)],
    "elastic_behind_lag": lambda n: [LaggedDrive(0.02), ElasticDrive(each(n, 2e3, 1e3), 0.7)],
    "gear_efficiency": lambda n: [GearEfficiency(each(n, 0.7, 0.05), 0.3, 2.0)],
    "gear_behind_motor": lambda n: [GearEfficiency(0.8, 0.3, 2.0), MotorDrive(0.1, 1.1, 0.0, 50.0)],
    "motor_drive": lambda n: [MotorDrive(each(n, 0.1, 0.02), 1.1, 2e-3, each(n, 50.0, 10.0))],
    "motor_without_inductance": lambda n: [MotorDrive(each(n, 0.1, 0.02), 1.1, 0.0, 50.0)],
    "motor_behind_elastic": lambda n: [ElasticDrive(2e3, each(n, 0.5, 0.2)), MotorDrive(0.1, 1.1, 2e-3, 50.0)],
    "winding_heat": lambda n: [WindingHeat(1.3, each(n, 200.0, 20.0), 390.0), MotorDrive(0.1, 1.1, 2e-3, 50.0)],
    "torque_speed": lambda n: [TorqueSpeed(each(n, 90.0, 10.0), 3.0, 80.0)],
    "torque_rate": lambda n: [TorqueRate((*each(n - 1, 900.0, 100.0), None))],
    "motion_limits": lambda n: [MotionLimits(each(n, 20.0, 2.0), None, 1.5)],
    "jerk_limit": lambda n: [LaggedDrive(each(n, 0.02, 0.01)), MotionLimits(jerk=each(n, 400.0, 20.0))],
    "power_limit": lambda n: [PowerLimit(500.0, 200.0)],
    "joint_stop": lambda n: [JointStop(each(n, -0.8, 0.1), each(n, 0.5, 0.1), 400.0, 0.2, 0.1)],
    "tool_force": lambda n: [ToolForce((11.0, -7.0, 5.0), (1.0, -2.0, 3.0))],
    "tool_force_in_tool_axes": lambda n: [ToolForce((11.0, -7.0, 5.0), (1.0, -2.0, 3.0), in_tool_axes=True)],
    "tool_force_of_time": lambda n: [ToolForce(swing)],
    "tool_force_of_signals": lambda n: [ToolForce(stiff, of=("tool", "tool_v"))],
    "counterweight": lambda n: [Counterbalance(7.0, at=(0.1, -0.2, -0.3)), Gravity(G)],
    "counter_spring": lambda n: [Counterbalance(stiffness=900.0, at=(0.1, 0.2, 0.3), anchor=(0.1, 0.0, 0.6),
                                                free_length=0.1)],
}  # fmt: skip
EVERYTHING = ("payload_rigid", "viscous", "coulomb", "rotor_inertia", "joint_stop", "tool_force_of_signals",
              "motor_drive", "torque_speed", "power_limit")  # fmt: skip


def everything(n):
    """Return many effects at once, counterbalance included."""
    return [effect for name in EVERYTHING for effect in CASES[name](n)] + [CASES["counterweight"](n)[0]]
