"""Loads carried beside the controller: a side's, what the hand feels of them, the driver."""
