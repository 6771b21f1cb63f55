"""Direct collocation: a problem on a grid becomes a sparse NLP with its exact derivatives."""
