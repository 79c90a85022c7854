"""Figures of the visual-strain paper, one function per figure, named after the paper's numbers."""
