"""How the rules of the shared-control simulator are compiled: into the one function that plays a trial."""

from numba.extending import register_jitable

# Nobody calls a rule from C; without that entry point numba compiles `play` about a sixth faster.
inlined = register_jitable(forceinline=True, no_cfunc_wrapper=True)
"""Decorator of a rule: plain Python to everybody else, compiled where a compiled function calls it."""
