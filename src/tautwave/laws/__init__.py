"""Control laws: small pure functions over floats, each with its own energy account.

Conventions, used everywhere in this package: `position`, `velocity` are those of the device.
Every element acts with a *resisting* effort R (N m or N, R > 0 pushes the device back), so
R times displacement is the energy that flows *into* the element. Waves are in W**0.5; half a
wave squared is power. Parameters travel in NamedTuples, state as plain floats in and out.
"""
