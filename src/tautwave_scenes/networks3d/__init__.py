"""Networks of points in three dimensions, beside the one-dimensional ones and with the same laws.

A link acts along the line between its ends (a contact with a `normal` along that). `network` is the
plain data, `arrays` lays it out, `stepping` is the standard scheme, `tension` and `solving` are the
discrete gradients, `live` runs them, `matrices` is the network near a position.
"""
