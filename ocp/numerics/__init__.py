"""Mathematics that knows no optimal control: polynomials, root finding, fast evaluation of CasADi functions."""
