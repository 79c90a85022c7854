"""Every controller on every arm: the same path, the same disturbance, only the `Robot` interface between."""
