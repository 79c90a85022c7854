"""The runner of the notebooks and all other commands: ``python -m soro_lib.workbook --help``.

Here belongs what works on whole notebooks, outputs and checkouts; it imports no paper. What a notebook itself
uses belongs to ``replication``.
"""

import sys

# nbformat validates notebooks with jsonschema, which would take a second to build a grammar of web addresses
# with letters beyond ASCII if it could; no notebook contains any.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]
