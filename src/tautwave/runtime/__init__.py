"""The live loop: one thread, bounded time, a safe stop on every exit."""
