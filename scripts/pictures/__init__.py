"""Pictures of solutions, switching structures, studies and torques."""
