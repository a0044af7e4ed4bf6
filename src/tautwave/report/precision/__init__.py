"""Precision of a run: against its oracle, and at half and double its rate."""
