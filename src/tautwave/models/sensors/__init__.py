"""What sensors make of what they measure."""
