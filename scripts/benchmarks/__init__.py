"""Problems, hand-written references and other tools for the benchmarks."""
