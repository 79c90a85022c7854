"""The runner of the notebooks and all other commands: ``python -m soro_lib.workbook --help``."""

import sys

# nbformat validates notebooks with jsonschema, which would take a second to build a grammar of web addresses
# with letters beyond ASCII if it could; no notebook contains any.
sys.modules.setdefault("rfc3987_syntax", None)  # type: ignore[arg-type]
