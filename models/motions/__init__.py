"""Motions q(t) from functions, profiles, waypoints, samples, files, paths and solutions."""
