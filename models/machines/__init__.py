"""The three manipulators of Maisser's paper: coordinates, metric, frames, bodies, inverse kinematics."""
