"""What the thesis tried, section by section, as tables; no figures, and nothing about published numbers."""
