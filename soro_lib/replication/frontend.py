"""Whether there is anyone to move a slider."""

import os

from IPython import get_ipython


def is_live() -> bool:
    """Return whether sliders can work: inside a Jupyter kernel that was not started by the runner.

    The runner is known by ``SORO_OUTPUT``, the folder that it makes a notebook write to; then, and outside a
    kernel, explorers show a picture instead.
    """
    return "SORO_OUTPUT" not in os.environ and hasattr(get_ipython(), "kernel")
