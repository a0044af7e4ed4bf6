"""Integrators of a mass at a contact: schemes, their bounds, and the choice between them."""
