"""Every controller on every arm (notebooks 00 and 05): the one room that looks into the others.

- ``world``: the four arms side by side, and on the bench with and without disturbance
- ``experiments``: the controllers behind one call (``laws``), the ``contest``, and ``ideas`` exchanged
- ``figures``: ``four_arms`` of the overview, ``laws`` of the contest
- ``explorer``: a slider per actuator
"""
