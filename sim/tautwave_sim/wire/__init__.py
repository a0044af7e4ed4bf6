"""What a wire does to frames and bytes: it takes time, and now and then it fails."""
