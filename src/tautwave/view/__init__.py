"""Viewers of a run in progress: a page, and Foxglove's protocol, from a process of their own.

They look at the recording's shared memory and write nothing into it; what people ask for goes the
way of all commands. A viewer that is slow, stopped or killed costs the run nothing.
"""
