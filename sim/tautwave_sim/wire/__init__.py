"""What a wire does to frames and bytes: delay, and faults now and then."""
