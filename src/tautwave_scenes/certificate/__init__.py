"""The certificate of a rig with a one-dimensional scene."""
