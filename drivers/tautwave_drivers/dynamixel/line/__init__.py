"""The serial line: the port, transactions with one servo, the adapter."""
