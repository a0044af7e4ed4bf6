"""Laws of links, and of tissue: pure functions over floats."""
