"""The simulated arm, its fibre, its camera's surroundings and how it is moved; nothing estimates here."""
