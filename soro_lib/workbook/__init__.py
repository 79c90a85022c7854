"""The runner of the notebooks: ``python -m soro_lib.workbook run``, ``list`` and ``html``."""
