"""Stroppa et al., Shared-Control Teleoperation on a Soft-Growing Robot (2023): the paper, section by section.

=========================================  =================================================================
In the paper                               Here (rules of the paper: `soro_lib.controllers.shared_control`)
=========================================  =================================================================
Sec. 3.1, Fig. 3 (arm, gripper)            ``world.plant``; kinematics: `soro_lib.robots.soft_growing`
Sec. 3.2 (haptic device), the person       ``world.people``, ``world.hand``, ``world.belief``,
                                           ``world.decision``, ``world.loop``
Sec. 3.3.1 (robot tracking)                ``world.plant.tracked_tip``
Sec. 4, Fig. 4 (goal selection)            ``controllers...goal_selection``; ``figures.paper``
Secs. 4.1, 4.4-4.6, Eqs. (1), (6)-(8),     ``controllers...paradigms``
Table 1
Sec. 4.2, Eqs. (2), (3), Fig. 5            ``controllers...guidance``, ``controllers...assist_as_needed``
Sec. 4.3, Eqs. (4), (5)                    ``controllers...fixed_assistance``
Sec. 5.1, Figs. 2, 6 (task)                ``experiments.task``, ``experiments.simulation``,
                                           ``figures.paper``
Sec. 5.2, Eqs. (9)-(11) (metrics)          ``experiments.metrics``, ``experiments.simulation``
Sec. 5.3, Tables 2, 3 (tuning study)       ``experiments.factorial``; ``figures.paper``
Sec. 5.4, Figs. 7-9 (demonstrations)       ``experiments.demonstrations``; ``figures.paper``
Sec. 5.5 (what is claimed of them)         ``experiments.claims``; ``figures.paper``
Supplement, Secs. 1-3, Eqs. S(1)-S(10)     `soro_lib.robots.soft_growing`
Supplement, Secs. 4, 5 (closed loop)       ``world.plant``: ``control_error``, ``real_tip``
Sec. 6 (blend), and beyond the paper       ``beyond``; ``figures.beyond``
Recorded trials                            ``experiments.trials``, ``experiments.recorder``,
                                           ``experiments.trial_format``; shipped ones: ``recordings``
Be the operator                            ``explorer``
Published numbers beside ours              ``findings``
=========================================  =================================================================
"""
