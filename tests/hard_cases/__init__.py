"""The cases of the stability suite, and how bad input is put to everything public."""
