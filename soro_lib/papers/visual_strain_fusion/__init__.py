"""Wang et al., Learning-Based Visual-Strain Fusion (T-RO 2023): the paper, section by section.

=====================================  =========================================================
In the paper                           Here
=====================================  =========================================================
Sec. II, Eqs. (1)-(17)                 `soro_lib.estimators.extreme_learning_machine`
Eq. (18) (fusion)                      `soro_lib.estimators.pose_fusion`, `soro_lib.estimators.visual_strain`
Sec. III, Eqs. (19)-(29)               `soro_lib.robots.pneumatic`, `soro_lib.controllers.hybrid`
Eq. (30) (scale of the camera)         `soro_lib.sensing.monocular_vision`
Fig. 3, Table VII (fibre)              ``world.fibre``, ``figures.estimation``
Sec. IV-B, Fig. 5 (camera alone)       ``experiments.camera_runs``, ``experiments.camera_views``
Sec. IV-C, Figs. 6-8 (fusion)          ``experiments.fusion_runs``, ``figures.camera``
Sec. IV-C (learning the fibre)         ``experiments.estimation``, ``figures.estimation``
Sec. IV-D, Figs. 9, 10, Tables I, II   ``experiments.tracking``, ``experiments.hybrid_control``,
                                       ``figures.tracking``; plant: ``world.plant``, ``calibration``
Sec. IV-E, Figs. 11, 12, 14(c)         ``experiments.closed_curve``, ``figures.tracking``
Sec. IV-F, Fig. 13, Tables III-VI      ``experiments.collisions``, ``figures.collisions``
Stored flights                         ``recordings``
Published numbers beside ours          ``findings``
=====================================  =========================================================
"""
