"""What is recorded of motors of both families."""

from __future__ import annotations

from tautwave_drivers.mit.driver import DAMPED, REPORTED
from tautwave_drivers.mit.robstride_driver import REPORTED as OF_ROBSTRIDE

COLUMNS = tuple({one.name: one for one in (*OF_ROBSTRIDE, *REPORTED, *DAMPED)}.values())
