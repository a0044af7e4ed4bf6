"""Many closed-loop simulations over a grid, as tables and maps."""
