"""Networks of masses and links, compiled."""
