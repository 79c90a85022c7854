"""Figures of the shared-control paper, one function per figure, named after the paper's numbers.

They draw tables that `experiments` and the room's `beyond` have computed; nothing is simulated here. `trials`
draws single trials (Figs. 2, 4, 5), `results` many (Figs. 7 to 9, claims, tuning study), `beyond` what the
paper leaves open.
"""
