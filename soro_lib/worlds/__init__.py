"""What plays the world for more than one paper: pictures, of flat things in `rendering`, of round ones in
`round_bodies`.

Here belongs what stands in for a sensor's surroundings and knows no robot. What only one paper needs belongs
in ``soro_lib/papers/<slug>/world``.
"""
