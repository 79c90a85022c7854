"""What the paper did, one module per experiment, each a function that returns runs or a table.

No drawing here, no numbers of the paper: those are in ``figures`` and ``findings``.
"""
