"""Bytes of requests and responses, registers, and what exceptions mean; no I/O."""
