"""What plays the world for more than one paper: rendered pictures.

What only one paper needs belongs in ``soro_lib/papers/<slug>/world``.
"""
