"""Two machines: who the other is, what is sealed between them, what the path is like."""
