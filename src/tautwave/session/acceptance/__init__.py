"""`tautwave accept`: the first day with real drives, led, measured, recorded, sealed."""
