"""The four arms: parameters, kinematics, limits, actuator maps and simulated plants."""
