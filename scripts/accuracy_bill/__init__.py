"""The bill of accuracy: errors and seconds of integrators, schemes, refinement, and other tools."""
