"""Ports, lines and whole pairs as linear systems: scattering, modes, two-ports, Z-width."""
