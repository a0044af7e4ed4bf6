"""What a run tells its viewers, and what of it they may change."""
