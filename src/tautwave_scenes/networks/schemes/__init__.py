"""Integration schemes of a network of masses and links, one module each, and their choice."""
