"""Figures of the shared-control paper, one function per figure, named after the paper's numbers.

They draw tables that `experiments` and the room's `beyond` have computed; nothing is simulated here. `paper`
draws what the paper shows, `beyond` what it leaves open.
"""
