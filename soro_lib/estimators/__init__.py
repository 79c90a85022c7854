"""Filters and learned estimators of the four papers."""
