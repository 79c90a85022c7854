"""Figures of the handover thesis: ``handovers`` and, on its cameras, ``vision``."""
