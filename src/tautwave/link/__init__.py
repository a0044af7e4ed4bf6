"""What joins two sites: counters on the wire, the receiver, the network between, clocks."""
