"""The simulated arm, the room, and what the cameras see of them."""
