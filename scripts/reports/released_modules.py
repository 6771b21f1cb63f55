"""Modules in which release 0.1.0 kept functions whose code is part of the identities of stored studies of scenes.

Their code must stay as it is, docstrings included, or those studies are computed again.
"""

RELEASED = """
study_measurement: measures _function _signals
"""
