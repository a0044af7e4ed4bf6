"""How a network of masses and links is stepped: one module a scheme, and which one is taken."""
