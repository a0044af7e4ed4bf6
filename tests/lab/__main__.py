"""`python -m tests.lab NAME`."""

from tests.lab.command import lab
from tests.lab.feel import feel
from tests.lab.measured_velocity import measured_velocity
from tests.lab.motor_walls import motor_walls
from tests.lab.papers.command import papers
from tests.lab.recovery import recovery
from tests.lab.renamed import renamed
from tests.lab.served_arms import served_arms
from tests.lab.soak import soak
from tests.lab.springs import springs
from tests.lab.strangers.shares import shares
from tests.lab.waiting import waiting

lab.add_command(feel)
lab.add_command(measured_velocity)
lab.add_command(motor_walls)
lab.add_command(papers)
lab.add_command(recovery)
lab.add_command(renamed)
lab.add_command(served_arms)
lab.add_command(soak)
lab.add_command(springs)
lab.add_command(shares)
lab.add_command(waiting)

if __name__ == "__main__":
    lab(prog_name="python -m tests.lab")
