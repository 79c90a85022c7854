"""The simulated hand and the simulated arm of the gesture-steering paper."""
