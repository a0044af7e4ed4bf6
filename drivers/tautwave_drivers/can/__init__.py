"""CAN for the drivers on it: ports, framing, lengths, keys and exchanges; no protocol above."""
