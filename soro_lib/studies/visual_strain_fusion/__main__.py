"""Simulate the recordings of this study again (``make data``)."""

import sys

from soro_lib.studies.visual_strain_fusion.record import main

sys.exit(main())
