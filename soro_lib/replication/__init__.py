"""From tables to pages: what a paper published beside what we obtain.

- published numbers, findings, the verdicts between them: `published`, `findings`, `scorecard`, `summary`,
  `policy`
- indices and cards: `equations` (with errata), `card` (of the replication), `datacards`, `tabular`
- what a notebook shows and writes: `page`, `markup`, `resolution`, `recording`, `picture`, `figure_map`
- words of figures and explorers: `plotting`, `view`, `frontend`

Here belongs what every paper's notebook needs to be judged and shown. It knows no paper; how notebooks are
run and compared belongs to ``workbook``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["plotting"],
    submod_attrs={"page": ["Page", "as_image"], "scorecard": ["build_scorecard", "verdict"]},
)
