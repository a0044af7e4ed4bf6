"""Keys of `scene`, their checks, and the files that they name."""
