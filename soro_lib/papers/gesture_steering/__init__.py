"""Lai et al., Gesture-based Steering Framework For Redundant Soft Robots: the paper, section by section.

=======================================  ============================================================
In the paper                             Here
=======================================  ============================================================
Sec. II, Eqs. (1)-(3), Table I           `soro_lib.robots.cable_driven`; ``experiments.tables``
Sec. III-A, Eqs. (4), (5)                `soro_lib.controllers.hand_mapping`
Sec. III-B and C, Eqs. (6)-(16)          `soro_lib.estimators.palm_filter`
Sec. III-D, Eqs. (17)-(20), Fig. 4       `soro_lib.controllers.gestures`, `soro_lib.controllers.hand_mapping`
Sec. III-E, Eqs. (21)-(27)               `soro_lib.robots.cable_driven`, `soro_lib.controllers.steering_step`
Algorithm 1                              `soro_lib.controllers.gesture_steering`
Sec. IV-A, Fig. 5 (hand, filters)        ``experiments.hands``, ``figures.hands``; ``recordings``
Sec. IV-B, Figs. 6-8, and V-A, Fig. 9    ``experiments.steering``, ``figures.steering``
Sec. V-B, Figs. 10, 11, Eq. (28)         ``experiments.prototype``, ``figures.prototype``; ``world.plant``
Table II                                 ``calibration``, ``experiments.tables``, ``experiments.prototype``
Sec. V-D, Fig. 14, Eq. (29)              ``experiments.avoidance``, ``figures.avoidance``
Beyond the paper                         ``beyond``, ``experiments.robustness``, ``explorer``
Published numbers beside ours            ``findings``
=======================================  ============================================================
"""
