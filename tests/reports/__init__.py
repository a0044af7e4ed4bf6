"""Files of `tautwave accept --share` that somebody handed on, played back by every test run.

Today there are three, made of our own simulators and marked so (`simulated`):
`python -m tests.reports.make`.
"""
