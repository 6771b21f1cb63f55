"""Terms of the equations of motion, collected from a machine and its effects."""
