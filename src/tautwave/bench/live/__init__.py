"""The live loop, measured in processes of its own."""
