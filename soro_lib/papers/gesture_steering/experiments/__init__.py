"""What the paper did, one module per group of figures, each experiment a function that returns a table.

No drawing here, no numbers of the paper: those are in ``figures`` and ``findings``.
"""
