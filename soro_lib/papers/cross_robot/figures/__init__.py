"""Figures of the notebooks on all arms."""
