"""The room of Vervloet, A first step to visual servoing based autonomous handovers with soft robots (2025).

What would run beside the real arm is in the library; here are the simulated arm, the room and the cameras'
pictures, and what the thesis tried. By its table of contents:

==================================  ===================================================================
Section, equation, figure           Where
==================================  ===================================================================
2, Eqs. (1)-(6), Fig. 1             ``soro_lib.arcs``, ``soro_lib.robots.helix``
3.1, Eqs. (7)-(11), Fig. 2          ``soro_lib.robots.helix``, ``soro_lib.controllers.virtual_stiffness``
3.2, Figs. 3, 4                     ``world.scene``, ``world.observer``; ``soro_lib.sensing``
3.2.5, Eqs. (12)-(15)               ``soro_lib.estimators.handover_filters``
3.3.1, Eq. (16), Fig. 5             ``soro_lib.estimators.shape_estimation``; ``world.plant`` sags
3.3.2-3, Eqs. (17)-(22), Alg. 1, 2  ``soro_lib.controllers.virtual_stiffness``
3.4, Algorithm 3                    ``soro_lib.controllers.handover``, ``experiments.handover``
3.5.1, 4.1, 4.2, Table 1            ``experiments.handover``
Figs. 6-10, 16-21                   ``figures.handovers``
3.5.2, 4.3, Figs. 11, 12, 22        ``experiments.guidance``; ``figures.handovers``
3.5.3, 4.4, Fig. 13                 ``experiments.use_case``; ``figures.handovers``
5.2, final distances                ``calibration`` (plant K is fitted to them), ``findings``
5.4.1, 5.4.2, Figs. 14, 15          ``experiments.vision_limits``; ``figures.vision``
5.4.3-5                             ``beyond``; ``figures.handovers``
Appendix A                          ``soro_lib.controllers.handover``; ``findings``
==================================  ===================================================================

Beside the thesis: ``experiments.variants`` (what the printed algorithm does), ``experiments.faults``,
``experiments.vision`` (how well the cameras know arm and ball), ``experiments.rendered_handovers`` (handovers
through rendered pictures). ``findings`` has every published number with ours, ``recordings`` makes what lies
in ``data/soft_handover``, ``explorer`` is the interactive figure.
"""
