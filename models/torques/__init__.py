"""Drive torques of given motions, their contributions, and the loads of the drives."""
