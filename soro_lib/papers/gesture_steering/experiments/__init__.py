"""The experiments of Lai et al., Gesture-based Steering Framework For Redundant Soft Robots.

``hands``: recordings and filters (Fig. 5); ``tables``: Tables I and II; ``steering``: Figs. 6 to 9;
``prototype``: Figs. 10, 11 and the errors of Table II; ``avoidance``: Fig. 14; ``beyond``: what the paper
leaves open; ``results``: all of it as findings for the scorecard.
"""
