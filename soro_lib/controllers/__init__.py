"""The control laws of the four papers."""
