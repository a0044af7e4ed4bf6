"""The live loop: one thread, bounded time, nothing that escapes without a safe stop."""
