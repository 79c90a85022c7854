"""Whether there is anyone to move a slider."""

import os


def is_live() -> bool:
    """Return whether sliders can work: inside a Jupyter kernel that the runner did not start headless.

    The runner sets ``SORO_HEADLESS=1``; then, and outside a kernel, explorers show a static figure.
    """
    if os.environ.get("SORO_HEADLESS", "0") not in ("", "0"):
        return False
    from IPython import get_ipython

    return getattr(get_ipython(), "kernel", None) is not None
