"""Two processes on this machine that exchange what two sites do."""
