"""Simulated drives on the wire: framing, TCP, RTU and the servers around them."""
