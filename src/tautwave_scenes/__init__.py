"""Physical models as controllers: networks of masses and links, and tissue, that a hand touches."""
