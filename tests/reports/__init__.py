"""Files of `tautwave accept --share` that somebody handed on; in `foreign`, of other hosts.

Every test run plays them back.

Today there are three, made of our own simulators and marked so (`simulated`):
`python -m tests.reports.make`.
"""
