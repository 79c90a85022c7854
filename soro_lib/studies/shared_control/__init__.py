"""The experiments of Stroppa et al.: the task, its simulated trials, the factorial, the demonstrations."""
