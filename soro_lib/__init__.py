"""Kinematics, filters, controllers and simulated plants of four soft-robot papers, in SI units throughout."""

__version__ = "0.1.0"
