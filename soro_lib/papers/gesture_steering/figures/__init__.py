"""Figures, one function per figure, named after the paper's numbers; they draw, and compute no results."""
