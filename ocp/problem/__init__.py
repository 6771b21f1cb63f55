"""What is asked: problems, constraints, regions, sequences of problems, rest-to-rest tasks, the Hamiltonian."""
