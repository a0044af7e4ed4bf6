"""What of the reference is written by the program itself."""
