"""Figures of the gesture-steering paper, one function per figure, named after the paper's numbers."""
