"""The experiments of Stroppa et al.: the task, its simulated trials, the demonstrations, the tuning study.

Here belongs what repeats or judges something that the paper did, and the recorded trials, which go through
the same metrics; what the paper leaves open is in the room's `beyond`.
"""
