"""From a problem to a solution: initial guesses, the NLP solver, checks before and a diagnosis after the solve."""
