"""A recorded scene of points in three dimensions."""
