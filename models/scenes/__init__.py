"""Scenes and tasks read from TOML files, their cards, and the templates of such files."""
