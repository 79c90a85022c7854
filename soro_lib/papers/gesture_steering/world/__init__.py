"""The simulated hand and the arm as it was built: what an experiment acts on, nothing that evaluates it."""
