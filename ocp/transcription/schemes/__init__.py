"""Collocation schemes, one file for each family."""
