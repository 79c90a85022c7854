"""From tables to pages: scorecards, equation indices, figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["plotting"],
    submod_attrs={"page": ["Page", "as_image"], "scorecard": ["build_scorecard", "verdict"]},
)
