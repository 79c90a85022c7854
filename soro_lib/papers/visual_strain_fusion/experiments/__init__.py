"""Experiments on visual-strain fusion and hybrid control (Wang et al., T-RO 2023)."""
