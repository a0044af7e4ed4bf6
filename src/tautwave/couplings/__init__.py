"""Laws that join a master and a slave axis, one folder each; found through the registry only."""
