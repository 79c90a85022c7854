"""One module per paper: the experiments, as pure functions from a random generator to tidy tables."""
