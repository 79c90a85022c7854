"""Look through the rendered cameras again (``make data``)."""

import sys

from soro_lib.studies.soft_handover.record import main

sys.exit(main())
