"""What was found: solutions and their files, error values, switching structures, constraint violations."""
