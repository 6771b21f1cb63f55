"""How wrong a solution is: error estimates, tolerances, grid refinement, independent verification."""
