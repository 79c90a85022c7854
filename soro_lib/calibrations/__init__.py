"""Declared calibrations: the only code besides the scorecard that may read a published value."""
