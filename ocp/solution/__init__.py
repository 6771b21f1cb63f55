"""Solutions and their files, error values, switching structures, constraint violations."""
