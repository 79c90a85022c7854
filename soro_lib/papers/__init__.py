"""One room per paper, each with the same file names, and one that looks into the others (``cross_robot``).

- ``world``: the simulated plant, scene and people
- ``experiments``: what the paper tried, section by section
- ``calibration``: the declared fits
- ``findings``: every published number with ours
- ``figures``: the paper's and our own
- ``beyond``: what the paper leaves open
- ``recordings``: simulates what lies in ``data/<slug>`` again
- ``explorer``: the interactive figure

What a paper does not need is absent. Papers never import each other. What would run beside a real arm
belongs in the library: robots, controllers, estimators, sensing; what two papers play alike, in ``worlds``.
"""
